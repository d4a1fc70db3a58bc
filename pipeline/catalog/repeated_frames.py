"""Frames that are stored several times: a header of 60 Hz over data of 30 Hz."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip

MOST_TIMES = 8
"""How often a frame may be stored and still be found."""
NO_STEP = 0.02
"""A step smaller than this share of the steps' 90th percentile is none: rounding of the file."""


def times_stored(clip: HumanClip | RobotClip, share: float) -> tuple[int, int]:
    """How often each frame is stored, and the first frame that differs from the one before it, below that number.

    1 for a sound clip, and for one that hardly moves. The pattern has to hold for `share` of the moving frames.
    """
    step = _steps(clip)
    step = step[np.isfinite(step)] if np.isfinite(step).any() else np.zeros(0)
    if len(step) < 2 * MOST_TIMES:
        return 1, 0
    moved = step > NO_STEP * np.percentile(step, 90.0)
    if moved.mean() < 0.5 / MOST_TIMES:
        return 1, 0
    for times in range(MOST_TIMES, 1, -1):
        counts = np.array([moved[phase::times].sum() for phase in range(times)])
        phase = int(np.argmax(counts))
        slots = len(moved[phase::times])
        if counts[phase] >= share * slots and counts[phase] >= share * counts.sum():
            return times, (phase + 1) % times
    return 1, 0


def each_once(clip: HumanClip | RobotClip, times: int, first: int) -> HumanClip | RobotClip:
    """Every `times`-th frame from `first` on, at the rate that keeps the clip's duration."""
    names = [field.name for field in dataclasses.fields(clip)]
    arrays = {name: getattr(clip, name) for name in names if isinstance(getattr(clip, name), np.ndarray)}
    taken = {name: values[first::times].copy() for name, values in arrays.items()}
    return dataclasses.replace(clip, fps=clip.fps / times, **taken)


def _steps(clip: HumanClip | RobotClip) -> Float[np.ndarray, " t-1"]:
    """Largest change from each frame to the next: of a person's joint positions [m], of a robot's joints [rad]."""
    if isinstance(clip, HumanClip):
        return np.linalg.norm(np.diff(clip.body_pos_w, axis=0), axis=2).max(axis=1)
    return np.abs(np.diff(clip.joint_pos, axis=0)).max(axis=1)
