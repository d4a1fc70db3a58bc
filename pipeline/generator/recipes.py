"""Recipes of the shipped motions, sound ones and ones with one injected defect each, and their sidecars.

A sidecar is its description, expected results in the pipeline, and seconds of each commanded skill.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float

from pipeline import time_series
from pipeline.generator import bvh
from pipeline.generator.command import GRID_HZ, LEAD_S, Commands, Level, Recipe, plan_commands
from pipeline.generator.generate import make_motion
from pipeline.generator.skeleton import Motion

Block = Float[np.ndarray, "t c"]


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Location of a defect, in the motion's own time."""

    code: str
    start_s: float
    stop_s: float
    effect: str
    """Expected effect: `repaired`, `cut` (these seconds are removed) or `rejected` (all of it)."""
    detail: str
    """Description of the defect."""


@dataclass(frozen=True, kw_only=True)
class Defect:
    """A sound recipe and the defect that is injected into it."""

    recipe: Recipe
    fate: str
    """`accepted`, `partly` or `rejected`."""
    faults: tuple[Fault, ...]
    plant: Callable[[Block, float], Block]
    """Motion block of the sound file (x and z on the floor in cm, y up, then angles in deg) and its rate -> spoilt."""
    declared_fps: float | None = None
    """Declared rate if it differs from the true one [Hz]."""


def make_defect(defect: Defect) -> tuple[Motion, str]:
    """The sound motion, and the text of the file with the defect."""
    motion, _ = make_motion(defect.recipe)
    block = defect.plant(bvh.channels(motion).copy(), motion.fps)
    return motion, bvh.to_text(block, defect.declared_fps or motion.fps)


LONG_DROPOUT = Fault(
    code="dropout", start_s=5.0, stop_s=5.6, effect="cut", detail="all angles of the left leg are 0 for .6 s"
)
SHORT_DROPOUT = Fault(
    code="dropout", start_s=2.0, stop_s=2.0833, effect="repaired", detail="all angles of the right arm are 0 for .08 s"
)
TELEPORT = Fault(code="teleport", start_s=4.0, stop_s=4.0, effect="cut", detail="from one frame to the next 60 cm off")
FROZEN = Fault(code="frozen", start_s=6.5, stop_s=8.0, effect="cut", detail="one frame repeated to the end")
TIME_BASE = Fault(
    code="time_base", start_s=0.0, stop_s=4.0, effect="repaired", detail="made at 120 Hz, the file says 25 Hz"
)
SKATE = Fault(
    code="foot_skate", start_s=0.0, stop_s=7.0, effect="rejected", detail="the whole body drifts ahead by .3 m/s"
)


def drop_out(block: Block, fps: float) -> Block:
    """Angles of the left leg, later of the right arm, set to zero."""
    for fault, joints in (
        (LONG_DROPOUT, ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe")),
        (SHORT_DROPOUT, ("RightShoulder", "RightArm", "RightForeArm", "RightHand")),
    ):
        frames = slice(round(fault.start_s * fps), round(fault.stop_s * fps))
        for joint in joints:
            block[frames, bvh.columns_of(joint)] = 0.0
    return block


def jump(block: Block, fps: float) -> Block:
    """From `TELEPORT` on everything is displaced by 48 cm to the left and 36 cm back."""
    block[round(TELEPORT.start_s * fps) :, [0, 2]] += (48.0, -36.0)
    return block


def freeze(block: Block, fps: float) -> Block:
    """The frame at which `FROZEN` starts is repeated to the end."""
    first = round(FROZEN.start_s * fps)
    block[first:] = block[first]
    return block


def unchanged(block: Block, fps: float) -> Block:
    """The sound file's motion block."""
    return block


def skate(block: Block, fps: float) -> Block:
    """The root drifts forward by 30 cm/s, so that standing feet slide."""
    block[:, 2] += 30.0 * np.arange(len(block)) / fps
    return np.round(block, bvh.DECIMALS)


def _walk(name: str, what: str, hold_s: float, speed: float, seed: int) -> Recipe:
    return Recipe(name=name, what=what, levels=(Level(hold_s=hold_s, forward=speed),), seed=seed)


_DEFECTS = (
    Defect(
        recipe=_walk("defect_dropout", "Walks at 1.1 m/s; a leg drops out for .6 s, an arm for .08 s.", 10.0, 1.1, 21),
        fate="partly",
        faults=(SHORT_DROPOUT, LONG_DROPOUT),
        plant=drop_out,
    ),
    Defect(
        recipe=_walk("defect_teleport", "Walks at 1.0 m/s; in the middle it jumps by 60 cm.", 8.0, 1.0, 22),
        fate="partly",
        faults=(TELEPORT,),
        plant=jump,
    ),
    Defect(
        recipe=_walk("defect_frozen", "Walks at .9 m/s; the last 1.5 s are one frame.", 8.0, 0.9, 23),
        fate="partly",
        faults=(FROZEN,),
        plant=freeze,
    ),
    Defect(
        recipe=Recipe(
            name="defect_time_base",
            what="Runs at 3.2 m/s; recorded at 120 Hz, declared as 25 Hz.",
            levels=(Level(hold_s=4.0, forward=3.2),),
            seed=24,
            gait="run",
            fps=120.0,
        ),
        fate="accepted",
        faults=(TIME_BASE,),
        plant=unchanged,  # the defect is the declared rate
        declared_fps=25.0,
    ),
    Defect(
        recipe=_walk("defect_foot_skate", "Walks at 1.0 m/s; the feet slide by .3 m/s while they stand.", 7.0, 1.0, 25),
        fate="rejected",
        faults=(SKATE,),
        plant=skate,
    ),
)

DEFECTS: dict[str, Defect] = {defect.recipe.name: defect for defect in _DEFECTS}


HOLD_S = 4.0
"""Time for which most speeds are held [s]."""


def _levels(command: str, *values: float) -> tuple[Level, ...]:
    """Values of one command (`forward`, `lateral`, `yaw_rate`), one after another."""
    return tuple(Level(hold_s=HOLD_S, **{command: value}) for value in values)


def _from_stand(command: str, *values: float) -> tuple[Level, ...]:
    return _still(1.0), *_levels(command, *values)


def _still(hold_s: float) -> Level:
    return Level(hold_s=hold_s)


def _curves(sign: float) -> tuple[Level, ...]:
    wide, tight = (1.2, 0.5), (0.8, 0.8)
    return tuple(Level(hold_s=4.5, forward=forward, yaw_rate=sign * rate) for forward, rate in (wide, tight))


_STOPS = (_still(1.5), Level(hold_s=2.5, forward=1.0), _still(2.2), Level(hold_s=2.5, forward=1.5), _still(2.2))
_SOUND: dict[str, tuple[str, tuple[Level, ...]]] = {
    "stand": ("Stands, swaying a little.", (_still(8.0),)),
    "walk_slow": ("From standing to slow walking: .3, .4 and .55 m/s.", _from_stand("forward", 0.3, 0.4, 0.55)),
    "walk": ("Walks straight ahead at .7, .95 and 1.2 m/s.", _levels("forward", 0.7, 0.95, 1.2)),
    "walk_fast": ("Walks fast straight ahead at 1.4, 1.7 and 1.97 m/s.", _levels("forward", 1.4, 1.7, 1.97)),
    "run_easy": ("Runs easily at 2.08, 2.36 and 2.64 m/s.", _levels("forward", 2.08, 2.36, 2.64)),
    "run_fast": ("Runs at 2.92, 3.2 and 3.5 m/s.", _levels("forward", 2.92, 3.2, 3.5)),
    "back": (
        "From standing to walking backwards: .3, .6, .85 and 1.06 m/s.",
        _from_stand("forward", -0.3, -0.6, -0.85, -1.06),
    ),
    "side_left": ("From standing to steps to the left: .35, .7 and 1.06 m/s.", _from_stand("lateral", 0.35, 0.7, 1.06)),
    "side_right": (
        "From standing to steps to the right: .35, .7 and 1.06 m/s.",
        _from_stand("lateral", -0.35, -0.7, -1.06),
    ),
    "turn_left": (
        "Turns in place to the left at .65, 1.1 and 1.6 rad/s, then stops.",
        (*_from_stand("yaw_rate", 0.65, 1.1, 1.6), _still(1.5)),
    ),
    "turn_right": (
        "Turns in place to the right at .65, 1.1 and 1.6 rad/s, then stops.",
        (*_from_stand("yaw_rate", -0.65, -1.1, -1.6), _still(1.5)),
    ),
    "curve_left": ("Walks curves to the left, wide and fast, then tight and slow.", _curves(1.0)),
    "curve_right": ("Walks curves to the right, wide and fast, then tight and slow.", _curves(-1.0)),
    "start_stop": ("Stands, walks at 1.0 m/s, stops, walks at 1.5 m/s, stops.", _STOPS),
}
_FURTHER: dict[str, dict[str, Any]] = {
    "run_easy": {"gait": "run"},
    "run_fast": {"gait": "run"},
    "start_stop": {"ramp_s": 1.2},
}

RECIPES: dict[str, Recipe] = {
    name: Recipe(name=name, what=what, levels=levels, seed=seed, **_FURTHER.get(name, {}))
    for seed, (name, (what, levels)) in enumerate(_SOUND.items(), start=1)
}


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
    table = ""
    sound = [Defect(recipe=recipe, fate="accepted", faults=(), plant=unchanged) for recipe in RECIPES.values()]
    for each in (*sound, *DEFECTS.values()):
        recipe = each.recipe
        yield f"{recipe.name}.bvh", make_defect(each)[1]
        yield f"{recipe.name}.yaml", yaml.safe_dump(sidecar(each), sort_keys=False, width=120, allow_unicode=True)
        seconds = (recipe.frame_count - 1) / recipe.fps
        table += f"| {recipe.name} | {seconds:.1f} | {each.fate} | {recipe.what} |\n"
    yield "README.md", README + table


MADE_BY = "pipeline.generator of this project; no recording of a person went into it"
LICENCE = "CC0-1.0"

STAND_SPEED, STAND_TURN = 0.15, np.deg2rad(20.0)
"""Limits below which the command is standing [m/s, rad/s]."""
TURN_SPEED, TURN_RATE = 0.35, np.deg2rad(30.0)
"""A command is turning below this speed and above this yaw rate [m/s, rad/s]."""
DIRECTION_RATIO = 1.2
"""Least ratio of sideways or backward speed to the perpendicular one [-]."""
FORWARD = (("walk_slow", 0.6), ("walk", 1.3), ("walk_fast_jog", 2.0), ("run", np.inf))
"""Forward skills and the speed they end at [m/s]."""
SHORTEST_S = 1.0
"""Shortest stretch of a skill [s]."""


def sidecar(defect: Defect) -> dict:
    """What a motion is, its defects with their expected effects, and its expected result in the pipeline."""
    recipe = defect.recipe
    codes = {
        effect: list(dict.fromkeys(fault.code for fault in defect.faults if fault.effect == effect))
        for effect in ("repaired", "cut", "rejected")
    }
    seconds = {} if defect.fate == "rejected" else skill_seconds(recipe)
    lost_s = sum(fault.stop_s - fault.start_s for fault in defect.faults if fault.effect == "cut")
    result: dict[str, Any] = {"what": recipe.what, "made_by": MADE_BY, "seed": recipe.seed, "licence": LICENCE}
    if defect.declared_fps is not None:
        result |= {"declared_fps": defect.declared_fps, "true_fps": recipe.fps}
    if defect.faults:
        names = ("code", "start_s", "stop_s", "detail", "effect")
        result["defects"] = [{name: getattr(fault, name) for name in names} for fault in defect.faults]
    result["expect"] = {
        "fate": defect.fate,
        "reasons": list(dict.fromkeys(codes["cut"] + codes["rejected"])),
        "skills": {skill: round(value - lost_s, 1) for skill, value in seconds.items()},
        "repaired": codes["repaired"],
    }
    return result


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
