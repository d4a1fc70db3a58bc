"""The sidecar of a motion: description and expected results in the pipeline."""

from __future__ import annotations

import yaml

from pipeline.generator.command import Recipe
from pipeline.generator.defects import Defect
from pipeline.generator.skills import skill_seconds

MADE_BY = "pipeline.generator of this project; no recording of a person went into it"
LICENCE = "CC0-1.0"


def of_sound(recipe: Recipe) -> dict:
    """Sidecar of a sound motion: all of it is accepted."""
    expect = {"fate": "accepted", "reasons": [], "skills": skill_seconds(recipe), "repaired": []}
    return {**_head(recipe), "expect": expect}


def of_defect(defect: Defect) -> dict:
    """Sidecar of a motion with defects: locations and expected effects."""
    codes = {effect: _codes(defect, effect) for effect in ("repaired", "cut", "rejected")}
    seconds = {} if defect.fate == "rejected" else skill_seconds(defect.recipe)
    lost_s = sum(fault.stop_s - fault.start_s for fault in defect.faults if fault.effect == "cut")
    expect = {
        "fate": defect.fate,
        "reasons": list(dict.fromkeys(codes["cut"] + codes["rejected"])),
        "skills": {skill: round(value - lost_s, 1) for skill, value in seconds.items()},
        "repaired": codes["repaired"],
    }
    faults = [
        {"code": fault.code, "start_s": fault.start_s, "stop_s": fault.stop_s, "detail": fault.detail}
        | {"effect": fault.effect}
        for fault in defect.faults
    ]
    rate = {} if defect.declared_fps is None else {"declared_fps": defect.declared_fps, "true_fps": defect.recipe.fps}
    return {**_head(defect.recipe), **rate, "defects": faults, "expect": expect}


def to_text(sidecar: dict) -> str:
    """YAML in the order given."""
    return yaml.safe_dump(sidecar, sort_keys=False, width=120, allow_unicode=True)


def _head(recipe: Recipe) -> dict:
    return {"what": recipe.what, "made_by": MADE_BY, "seed": recipe.seed, "licence": LICENCE}


def _codes(defect: Defect, effect: str) -> list[str]:
    return list(dict.fromkeys(fault.code for fault in defect.faults if fault.effect == effect))
