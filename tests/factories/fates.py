"""The outcome of a motion file in the first stages, compared with that of the clean file it was made from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.catalog import CatalogSettings, catalogue_file
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Clip, Outcome, Piece, Reason
from pipeline.errors import FileError
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility import process as feasibility
from pipeline.files import settings
from pipeline.readers import Source
from pipeline.repair import RepairSettings
from pipeline.repair import process as repair
from pipeline.robot import load_robot
from tests.factories.mutant import EQUAL, FLAGGED, REFUSED

ROOT = Path(__file__).resolve().parents[2]
CATALOG = settings.read(ROOT / "data/catalog.yaml", CatalogSettings)
REPAIR = settings.read(ROOT / "data/repair.yaml", RepairSettings)
FEASIBILITY = settings.read(ROOT / "data/feasibility.yaml", FeasibilitySettings)
T1 = load_robot("t1")
CHANGED = "silently another motion"
"""A clip that differs from the clean one without a reason."""
USUAL = ("mean_skeleton", "assumed_rate")
"""Reasons that the clean files have as well."""


def catalogued(path: Path) -> Outcome:
    """The catalogue's outcome for a file."""
    source = Source(name="mine", folder=path.parent, licence="CC0-1.0")
    return catalogue_file(path, "mine/clip", source, path.name, settings=CATALOG)


def numbers_of(clip: Clip) -> list[np.ndarray]:
    """All numbers of a clip, quaternions without their sign."""
    if isinstance(clip, HumanClip):
        return [np.array(clip.fps), clip.body_pos_w, np.abs(clip.body_quat_w)]
    return [np.array(clip.fps), clip.root_pos_w, np.abs(clip.root_quat_w), clip.joint_pos]


def same(clip: Clip, clean: Clip) -> bool:
    """Equal to a micrometre, a microradian and the digits of a rate."""
    pairs = list(zip(numbers_of(clip), numbers_of(clean), strict=True))
    return all(a.shape == b.shape for a, b in pairs) and all(np.allclose(a, b, rtol=2e-5, atol=2e-6) for a, b in pairs)


def later_reasons(piece: Piece) -> list[Reason]:
    """The reasons of repair; for a robot's clip without any, those of feasibility."""
    reasons = repair(piece.clip, piece.numbers, settings=REPAIR, robot=T1).reasons
    if not reasons and not isinstance(piece.clip, HumanClip):
        reasons = feasibility(piece.clip, {}, settings=FEASIBILITY, robot=T1).reasons
    return list(reasons)


def new_findings(piece: Piece, clean: Piece) -> list[str]:
    """Later reasons that the clean clip does not have: of another kind, or with more than twice the value."""
    known = later_reasons(clean)

    def is_known(reason: Reason) -> bool:
        alike = [each for each in known if each.code == reason.code]
        return any(abs((reason.value or 0.0) - (each.value or 0.0)) <= abs(each.value or 0.0) for each in alike)

    return [reason.text for reason in later_reasons(piece) if not is_known(reason)]


def fate(path: Path, clean: Piece) -> tuple[str, str]:
    """`refused`, `equal`, `flagged` or `CHANGED`, and the sentence or reasons."""
    try:
        outcome = catalogued(path)
    except FileError as error:
        return REFUSED, str(error)
    reasons = [reason.text for reason in outcome.reasons if reason.code not in USUAL]
    if outcome.pieces and not reasons and same(outcome.pieces[0].clip, clean.clip):
        return EQUAL, ""
    if outcome.pieces and not reasons:
        reasons = new_findings(outcome.pieces[0], clean)
    return (FLAGGED, " ".join(reasons)) if reasons else (CHANGED, "")
