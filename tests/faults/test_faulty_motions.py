"""Motion files with a planted fault are understood, flagged or refused in a sentence, by the stages and the command."""

import contextlib
import io
import json
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from pipeline.catalog import CatalogSettings, catalogue_file
from pipeline.cli.main import main
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility import process as feasibility
from pipeline.files import settings
from pipeline.readers import Source
from pipeline.repair import RepairSettings
from pipeline.repair import process as repair
from pipeline.robot import load_robot
from tests.factories import mutants_bvh, mutants_npz, mutants_text
from tests.factories.mutant import EQUAL, FLAGGED, REFUSED, Mutant, understood

ROOT = Path(__file__).resolve().parents[2]
CATALOG = settings.read(ROOT / "data/catalog.yaml", CatalogSettings)
REPAIR = settings.read(ROOT / "data/repair.yaml", RepairSettings)
FEASIBILITY = settings.read(ROOT / "data/feasibility.yaml", FeasibilitySettings)
T1 = load_robot("t1")
LEAST_MUTANTS = 200

CORPUS: dict[str, tuple[Mutant, list[Mutant]]] = {
    "bvh": (understood("walk.bvh", {"clean": mutants_bvh.CLEAN})[0], mutants_bvh.bvh_mutants()),
    "amc": (
        understood("07_01.amc", {"clean": mutants_text.AMC}, beside=mutants_text.BESIDE)[0],
        mutants_text.amc_mutants(),
    ),
    "deepmimic": (
        understood("walk.txt", {"clean": json.dumps(mutants_text.MOTION)})[0],
        mutants_text.deepmimic_mutants(),
    ),
    "csv": (understood("robot.csv", {"clean": mutants_text.robot_csv()})[0], mutants_text.csv_mutants()),
    "npz": (
        understood("walk.npz", {"clean": mutants_npz.packed(mutants_npz.arrays())})[0],
        mutants_npz.npz_mutants(),
    ),
}
"""Format -> its clean file and all faults of it."""


def catalogued(path):
    """The stage's outcome for a file."""
    source = Source(name="mine", folder=path.parent, licence="CC0-1.0")
    return catalogue_file(path, "mine/clip", source, path.name, settings=CATALOG)


def numbers_of(clip):
    """All that a clip holds, quaternions without their sign."""
    if isinstance(clip, HumanClip):
        return [np.array(clip.fps), clip.body_pos_w, np.abs(clip.body_quat_w)]
    return [np.array(clip.fps), clip.root_pos_w, np.abs(clip.root_quat_w), clip.joint_pos]


def same(clip, clean) -> bool:
    """Equal to a micrometre, a microradian and the digits of a rate."""
    pairs = list(zip(numbers_of(clip), numbers_of(clean), strict=True))
    return all(a.shape == b.shape for a, b in pairs) and all(np.allclose(a, b, rtol=2e-5, atol=2e-6) for a, b in pairs)


def later_reasons(piece) -> list[Reason]:
    """What repair says of a clip; of a robot's, where that is nothing, whether the robot can do it."""
    reasons = repair(piece.clip, piece.numbers, settings=REPAIR, robot=T1).reasons
    if not reasons and not isinstance(piece.clip, HumanClip):
        reasons = feasibility(piece.clip, {}, settings=FEASIBILITY, robot=T1).reasons
    return list(reasons)


def told_of_the_fault(piece, clean) -> list[str]:
    """What is said of a clip later on and not of the clean one too: of another kind, or more than twice as much."""
    known = later_reasons(clean)

    def is_known(reason: Reason) -> bool:
        alike = [each for each in known if each.code == reason.code]
        return any(abs((reason.value or 0.0) - (each.value or 0.0)) <= abs(each.value or 0.0) for each in alike)

    return [reason.text for reason in later_reasons(piece) if not is_known(reason)]


def fate(path, clean) -> tuple[str, str]:
    """What became of a file, and what was said."""
    try:
        outcome = catalogued(path)
    except FileError as error:
        return REFUSED, str(error)
    told = [reason.text for reason in outcome.reasons if reason.code not in ("mean_skeleton", "assumed_rate")]
    if outcome.pieces and not told and same(outcome.pieces[0].clip, clean.clip):
        return EQUAL, ""
    if outcome.pieces and not told:
        told = told_of_the_fault(outcome.pieces[0], clean)
    return (FLAGGED, " ".join(told)) if told else ("silently another motion", "")


def faults_of(mutant, got, said, path) -> list[str]:
    """What is wrong with how a mutant was dealt with."""
    faults = []
    if got != mutant.want:
        faults.append(f"{mutant.name}: {got}, wanted {mutant.want} ({said[:160]})")
    elif mutant.want == REFUSED:
        if not re.search(mutant.says, said):
            faults.append(f"{mutant.name}: the sentence says nothing like '{mutant.says}': {said[:300]}")
        if path.parent.name not in said or not 10 < len(said) < 1_500 or "\n" in said:
            faults.append(f"{mutant.name}: no sentence that names the file: {said[:300]}")
    return faults


@pytest.mark.parametrize("kind", CORPUS)
def test_the_stage_understands_flags_or_refuses_each_file(tmp_path, kind):
    clean_mutant, mutants = CORPUS[kind]
    clean = catalogued(clean_mutant.put(tmp_path / "clean")).pieces[0]
    faults = []
    for index, mutant in enumerate(mutants):
        path = mutant.put(tmp_path / f"mutant{index}")
        faults += faults_of(mutant, *fate(path, clean), path)
    assert not faults, "\n".join(["", *faults])


@pytest.mark.parametrize("kind", CORPUS)
def test_what_is_said_of_the_clean_file_too_tells_of_no_fault(tmp_path, kind):
    clean = catalogued(CORPUS[kind][0].put(tmp_path / "clean")).pieces[0]
    assert told_of_the_fault(clean, clean) == []


@pytest.mark.parametrize("kind", CORPUS)
def test_the_command_tells_one_sentence_or_the_clip_and_no_traceback(tmp_path, kind):
    faults = []
    for index, mutant in enumerate(CORPUS[kind][1]):
        path = mutant.put(tmp_path / f"mutant{index}")
        out, said = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
            code = main(["inspect", str(path), "--json"])
        lines = said.getvalue().splitlines()
        told = code == 1 and len(lines) == 1 and lines[0].startswith("booster-lab: ") and path.parent.name in lines[0]
        if not (code == 0 and out.getvalue().startswith("{") if mutant.want != REFUSED else told):
            faults.append(f"{mutant.name}: exit {code}, {said.getvalue()[:300]}")
    assert not faults, "\n".join(["", *faults])


def test_the_corpus_is_large_and_each_fault_is_another():
    every = [mutant for _, mutants in CORPUS.values() for mutant in mutants]
    assert len(every) >= LEAST_MUTANTS
    assert Counter(mutant.name for mutant in every).most_common(1)[0][1] == 1
    contents = Counter((mutant.file, mutant.content, str(mutant.beside)) for mutant in every)
    assert contents.most_common(1)[0][1] == 1, [key[0] for key, count in contents.items() if count > 1]
