"""Frames that are stored several times: a header of 60 Hz over data of 30 Hz."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip

MOST_TIMES = 8
"""How often a frame may be stored and still be found."""
NO_STEP = 1e-7
"""Steps up to this [m or rad] are none: the same numbers went through another arithmetic."""
LEAST_MOVED = 0.5
"""Share of the distinct frames that have to differ from the one before: a frozen clip shows no pattern."""
LEAST_SEEN = 0.5
"""Share of the other steps that have to be known: a step beside a missing frame is not known to be none."""


def times_stored(clip: HumanClip | RobotClip, share: float) -> tuple[int, int]:
    """How often each frame is stored, and the file's frame at which the first whole group begins.

    `(1, 0)` for a sound clip, and for one that hardly moves. `share` of all moves have to be in the pattern.
    """
    step = _steps(clip)
    moved, known = np.nan_to_num(step) > NO_STEP, np.isfinite(step)
    if len(step) < 2 * MOST_TIMES or not moved.any():
        return 1, 0
    for times in range(MOST_TIMES, 1, -1):
        counts = np.array([moved[phase::times].sum() for phase in range(times)])
        phase = int(np.argmax(counts))
        slots = known[phase::times].sum()
        if known.sum() - slots < LEAST_SEEN * (len(step) - slots):
            continue
        if counts[phase] >= share * counts.sum() and counts[phase] >= LEAST_MOVED * slots:
            return times, (phase + 1) % times
    return 1, 0


def each_once(clip: HumanClip | RobotClip, times: int, first: int) -> HumanClip | RobotClip:
    """Every `times`-th frame from `first` on, at the rate that keeps the clip's duration."""
    names = [field.name for field in dataclasses.fields(clip)]
    arrays = {name: getattr(clip, name) for name in names if isinstance(getattr(clip, name), np.ndarray)}
    taken = {name: values[first::times].copy() for name, values in arrays.items()}
    return dataclasses.replace(clip, fps=clip.fps / times, **taken)


def _steps(clip: HumanClip | RobotClip) -> Float[np.ndarray, " steps"]:
    """Largest change from each frame to the next: of a person's joint positions [m], of a robot's joints [rad]."""
    if isinstance(clip, HumanClip):
        return rotation.length(np.diff(clip.body_pos_w, axis=0)).max(axis=1)
    return np.abs(np.diff(clip.joint_pos, axis=0)).max(axis=1)
