"""The sound motions that ship with the project, and the sidecar of each motion.

A sidecar is its description, expected results in the pipeline, and seconds of each commanded skill.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import yaml

from pipeline import time_series
from pipeline.generator.command import GRID_HZ, LEAD_S, Commands, Level, Recipe, plan_commands
from pipeline.generator.defects import DEFECTS, Defect, make_defect
from pipeline.generator.generate import generate

HOLD_S = 4.0
"""Time for which most speeds are held [s]."""


def _levels(command: str, *values: float) -> tuple[Level, ...]:
    """Values of one command (`forward`, `lateral`, `yaw_rate`), one after another."""
    return tuple(Level(hold_s=HOLD_S, **{command: value}) for value in values)


def _still(hold_s: float) -> Level:
    return Level(hold_s=hold_s)


def _recipe(name: str, seed: int, what: str, *levels: Level, gait: str = "walk", ramp_s: float = 1.0) -> Recipe:
    return Recipe(name=name, what=what, levels=levels, seed=seed, gait=gait, ramp_s=ramp_s)


_ALL = (
    _recipe("stand", 1, "Stands, swaying a little.", _still(8.0)),
    _recipe(
        "walk_slow",
        2,
        "From standing to slow walking: .3, .4 and .55 m/s.",
        _still(1.0),
        *_levels("forward", 0.3, 0.4, 0.55),
    ),
    _recipe("walk", 3, "Walks straight ahead at .7, .95 and 1.2 m/s.", *_levels("forward", 0.7, 0.95, 1.2)),
    _recipe("walk_fast", 4, "Walks fast straight ahead at 1.4, 1.7 and 1.97 m/s.", *_levels("forward", 1.4, 1.7, 1.97)),
    _recipe(
        "run_easy", 5, "Runs easily at 2.08, 2.36 and 2.64 m/s.", *_levels("forward", 2.08, 2.36, 2.64), gait="run"
    ),
    _recipe("run_fast", 6, "Runs at 2.92, 3.2 and 3.5 m/s.", *_levels("forward", 2.92, 3.2, 3.5), gait="run"),
    _recipe(
        "back",
        7,
        "From standing to walking backwards: .3, .6, .85 and 1.06 m/s.",
        _still(1.0),
        *_levels("forward", -0.3, -0.6, -0.85, -1.06),
    ),
    _recipe(
        "side_left",
        8,
        "From standing to steps to the left: .35, .7 and 1.06 m/s.",
        _still(1.0),
        *_levels("lateral", 0.35, 0.7, 1.06),
    ),
    _recipe(
        "side_right",
        9,
        "From standing to steps to the right: .35, .7 and 1.06 m/s.",
        _still(1.0),
        *_levels("lateral", -0.35, -0.7, -1.06),
    ),
    _recipe(
        "turn_left",
        10,
        "Turns in place to the left at .65, 1.1 and 1.6 rad/s, then stops.",
        *(_still(1.0), *_levels("yaw_rate", 0.65, 1.1, 1.6), _still(1.5)),
    ),
    _recipe(
        "turn_right",
        11,
        "Turns in place to the right at .65, 1.1 and 1.6 rad/s, then stops.",
        *(_still(1.0), *_levels("yaw_rate", -0.65, -1.1, -1.6), _still(1.5)),
    ),
    _recipe(
        "curve_left",
        12,
        "Walks curves to the left, wide and fast, then tight and slow.",
        Level(hold_s=4.5, forward=1.2, yaw_rate=0.5),
        Level(hold_s=4.5, forward=0.8, yaw_rate=0.8),
    ),
    _recipe(
        "curve_right",
        13,
        "Walks curves to the right, wide and fast, then tight and slow.",
        Level(hold_s=4.5, forward=1.2, yaw_rate=-0.5),
        Level(hold_s=4.5, forward=0.8, yaw_rate=-0.8),
    ),
    _recipe(
        "start_stop",
        14,
        "Stands, walks at 1.0 m/s, stops, walks at 1.5 m/s, stops.",
        *(_still(1.5), Level(hold_s=2.5, forward=1.0), _still(2.2), Level(hold_s=2.5, forward=1.5), _still(2.2)),
        ramp_s=1.2,
    ),
)

RECIPES: dict[str, Recipe] = {recipe.name: recipe for recipe in _ALL}


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
    rows, lines = [], ""
    for name, recipe in RECIPES.items():
        yield f"{name}.bvh", generate(recipe).bvh
        yield f"{name}.yaml", to_text(of_sound(recipe))
        rows.append((recipe, "accepted"))
    for name, defect in DEFECTS.items():
        yield f"{name}.bvh", make_defect(defect)[1]
        yield f"{name}.yaml", to_text(of_defect(defect))
        rows.append((defect.recipe, defect.fate))
    for recipe, fate in rows:
        lines += f"| {recipe.name} | {(recipe.frame_count - 1) / recipe.fps:.1f} | {fate} | {recipe.what} |\n"
    yield "README.md", README + lines


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
    codes = {
        effect: list(dict.fromkeys(fault.code for fault in defect.faults if fault.effect == effect))
        for effect in ("repaired", "cut", "rejected")
    }
    seconds = {} if defect.fate == "rejected" else skill_seconds(defect.recipe)
    lost_s = sum(fault.stop_s - fault.start_s for fault in defect.faults if fault.effect == "cut")
    expect = {
        "fate": defect.fate,
        "reasons": list(dict.fromkeys(codes["cut"] + codes["rejected"])),
        "skills": {skill: round(value - lost_s, 1) for skill, value in seconds.items()},
        "repaired": codes["repaired"],
    }
    faults = [
        {name: getattr(fault, name) for name in ("code", "start_s", "stop_s", "detail", "effect")}
        for fault in defect.faults
    ]
    rate = {} if defect.declared_fps is None else {"declared_fps": defect.declared_fps, "true_fps": defect.recipe.fps}
    return {**_head(defect.recipe), **rate, "defects": faults, "expect": expect}


def to_text(sidecar: dict) -> str:
    """YAML in the order given."""
    return yaml.safe_dump(sidecar, sort_keys=False, width=120, allow_unicode=True)


def _head(recipe: Recipe) -> dict:
    return {"what": recipe.what, "made_by": MADE_BY, "seed": recipe.seed, "licence": LICENCE}


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
