"""Motions with one planted defect each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.generator import bvh
from pipeline.generator.command import Level, Recipe
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
    """A sound recipe and the defect that is planted into it."""

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


def skate(block: Block, fps: float) -> Block:
    """The root drifts forward by 30 cm/s, so that standing feet slide."""
    block[:, 2] += 30.0 * np.arange(len(block)) / fps
    return np.round(block, bvh.DECIMALS)


def _walk(name: str, what: str, hold_s: float, speed: float, seed: int) -> Recipe:
    return Recipe(name=name, what=what, levels=(Level(hold_s=hold_s, forward=speed),), seed=seed)


_ALL = (
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
        plant=lambda block, fps: block,  # the defect is the declared rate
        declared_fps=25.0,
    ),
    Defect(
        recipe=_walk("defect_foot_skate", "Walks at 1.0 m/s; the feet slide by .3 m/s while they stand.", 7.0, 1.0, 25),
        fate="rejected",
        faults=(SKATE,),
        plant=skate,
    ),
)

DEFECTS: dict[str, Defect] = {defect.recipe.name: defect for defect in _ALL}
