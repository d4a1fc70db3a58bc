"""The sidecar of a motion: description, expected results in the pipeline, and seconds of each commanded skill."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import yaml

from pipeline import time_series
from pipeline.generator.command import GRID_HZ, LEAD_S, Commands, Recipe, plan_commands
from pipeline.generator.defects import DEFECTS, Defect, make_defect
from pipeline.generator.generate import generate
from pipeline.generator.recipes import RECIPES

README = """# Motions that ship with the project

Made by `python -m pipeline.generator data/motions`, byte for byte the same every time; do not edit them by hand. No
recording of a person went into them. Licence: CC0-1.0, use them for anything. docs/motions.md tells how they are made.

Beside each `<clip>.bvh` lies `<clip>.yaml`: what the clip is, and under `expect` what must happen to it in the
pipeline: its fate (`accepted`, `partly`, `rejected`), the reasons for what is lost, what is repaired, and the seconds
of each skill. The clips `defect_*` were sound and then spoilt; `defects` in their sidecar says how and where.

| clip | seconds | fate | what |
|---|---|---|---|
"""


def texts() -> Iterator[tuple[str, str]]:
    """File name and content of every file, one at a time."""
    rows = []
    for name, recipe in RECIPES.items():
        yield f"{name}.bvh", generate(recipe).bvh
        yield f"{name}.yaml", to_text(of_sound(recipe))
        rows.append((recipe, "accepted"))
    for name, defect in DEFECTS.items():
        yield f"{name}.bvh", make_defect(defect)[1]
        yield f"{name}.yaml", to_text(of_defect(defect))
        rows.append((defect.recipe, defect.fate))
    lines = [
        f"| {recipe.name} | {(recipe.frame_count - 1) / recipe.fps:.1f} | {fate} | {recipe.what} |"
        for recipe, fate in rows
    ]
    yield "README.md", README + "\n".join(lines) + "\n"


MADE_BY = "pipeline.generator of this project; no recording of a person went into it"
LICENCE = "CC0-1.0"

STAND_SPEED, STAND_TURN = 0.15, np.deg2rad(20.0)
"""Limits below which the command is standing [m/s, rad/s]."""
TURN_SPEED, TURN_RATE = 0.35, np.deg2rad(30.0)
"""Slower than the first and turning faster than the second is turning [m/s, rad/s]."""
DIRECTION_RATIO = 1.2
"""To the side or back: faster that way by this factor than the other [-]."""
FORWARD = (("walk_slow", 0.6), ("walk", 1.3), ("walk_fast_jog", 2.0), ("run", np.inf))
"""Forward skills and the speed they end at [m/s]."""
SHORTEST_S = 1.0
"""Shortest stretch of a skill [s]."""


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


def skill_seconds(recipe: Recipe) -> dict[str, float]:
    """Seconds of each skill that a recipe commands, in stretches of `SHORTEST_S` and more; rounded to .1 s."""
    commands = plan_commands(recipe)
    ends = int(LEAD_S * GRID_HZ)
    labels = label(commands)[ends:-ends]
    seconds: dict[str, float] = {}
    for skill in dict.fromkeys(labels.tolist()):
        lengths = [(stop - start) / GRID_HZ for start, stop in time_series.runs(labels == skill)]
        total_s = sum(length for length in lengths if length >= SHORTEST_S)
        if total_s > 0.0 and skill != "transition":
            seconds[skill] = round(total_s, 1)
    return seconds


def label(commands: Commands) -> np.ndarray:
    """Skill at every moment of the commands (n,); `transition` where no definition holds."""
    forward, lateral, turn = commands.forward, commands.lateral, commands.yaw_rate
    speed = np.hypot(forward, lateral)
    names = np.full(len(speed), "transition", dtype="<U16")
    low = 0.0
    for skill, high in FORWARD:
        names[(forward >= low) & (forward < high) & (speed >= STAND_SPEED)] = skill
        low = high
    names[(forward < 0.0) & (-forward > DIRECTION_RATIO * np.abs(lateral)) & (speed >= STAND_SPEED)] = "back"
    sideways = (np.abs(lateral) > DIRECTION_RATIO * np.abs(forward)) & (speed >= STAND_SPEED)
    names[sideways & (lateral > 0.0)], names[sideways & (lateral < 0.0)] = "side_left", "side_right"
    turning = (speed < TURN_SPEED) & (np.abs(turn) > TURN_RATE)
    names[turning & (turn > 0.0)], names[turning & (turn < 0.0)] = "turn_left", "turn_right"
    names[(speed < STAND_SPEED) & (np.abs(turn) < STAND_TURN)] = "stand"
    names[(speed < STAND_SPEED) & (np.abs(turn) >= STAND_TURN) & (np.abs(turn) <= TURN_RATE)] = "transition"
    return names
