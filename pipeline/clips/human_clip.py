"""A human motion on the canonical skeleton, independent of the file format."""

import dataclasses
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series

Own = TypeVar("Own", bound="Frames")


class Frames(ABC):
    """Base of the frozen dataclasses of clips: `fps`, `frame_count`, and arrays of one row per frame.

    Booleans are labels; names with `quat` are rotations; other arrays are quantities. A nested object with a method
    `cut` (simulated forces) has its own rate.
    """

    fps: float
    """Frames per second [Hz]."""

    @property
    @abstractmethod
    def frame_count(self) -> int:
        """Number of frames."""

    @property
    def duration_s(self) -> float:
        return self.frame_count / self.fps

    def cut(self: Own, start: int, stop: int, name: str) -> Own:
        """Frames [start, stop) under a new name."""
        parts = {key: value[start:stop].copy() for key, value in vars(self).items() if isinstance(value, np.ndarray)}
        nested = {key: value.cut(start, stop) for key, value in vars(self).items() if hasattr(value, "cut")}
        return self._with(name=name, **parts, **nested)

    def resampled(self: Own, fps: float) -> Own:
        """The same motion at another rate, by time: quantities linearly, rotations by slerp, labels from the nearest
        frame. Simulated forces are dropped."""
        if fps == self.fps:
            return self
        times_s = time_series.resample_times(self.frame_count, self.fps, fps)
        changed: dict[str, Any] = {key: None for key, value in vars(self).items() if hasattr(value, "cut")}
        for key, value in vars(self).items():
            if isinstance(value, np.ndarray):
                labels, rotations = value.dtype == bool, "quat" in key
                method = time_series.resample_quat if rotations else time_series.resample_linear
                changed[key] = (time_series.resample_nearest if labels else method)(value, self.fps, times_s)
        return self._with(fps=fps, **changed)

    def _with(self: Own, **changed: Any) -> Own:
        return dataclasses.replace(self, **changed)  # pyright: ignore[reportArgumentType, reportType]


PARENTS: dict[str, str] = {
    "spine": "pelvis",
    "chest": "spine",
    "neck": "chest",
    "head": "neck",
    "left_hip": "pelvis",
    "left_knee": "left_hip",
    "left_ankle": "left_knee",
    "left_toe": "left_ankle",
    "right_hip": "pelvis",
    "right_knee": "right_hip",
    "right_ankle": "right_knee",
    "right_toe": "right_ankle",
    "left_shoulder": "chest",
    "left_elbow": "left_shoulder",
    "left_wrist": "left_elbow",
    "right_shoulder": "chest",
    "right_elbow": "right_shoulder",
    "right_wrist": "right_elbow",
}

BODIES: tuple[str, ...] = ("pelvis", *PARENTS)
"""Canonical bodies in order. A body's position is that of the joint at its upper end (`left_knee` is
the knee joint and the shank below it, `left_shoulder` the shoulder joint and the upper arm,
`left_toe` the ball of the foot); `chest` is the upper spine, the body that carries neck and arms."""

PARENT: tuple[int, ...] = (-1, *(BODIES.index(parent) for parent in PARENTS.values()))
"""Index of each body's parent, -1 for the pelvis; a parent comes before its children."""

FEET: tuple[str, str] = ("left", "right")

_INDEX = {name: index for index, name in enumerate(BODIES)}


def body(name: str) -> int:
    """Index of a canonical body."""
    return _INDEX[name]


@dataclass(frozen=True, kw_only=True)
class HumanClip(Frames):
    """World: right-handed, z up, the ground near z = 0. T frames, 19 bodies in the order of `BODIES`.

    Body frames are canonical for every skeleton: for a person standing upright and looking along +x
    all of them are x forward, y left, z up (`spine`, `neck`, `head` follow their bodies' rotation from there).
    Missing samples are NaN until KP2 has filled or cut them.
    """

    name: str
    """Unique name of the clip; `<source>/<path without suffix>`, pieces add `#<first>-<last>` and the like."""
    fps: float
    """Frames per second [Hz]."""
    body_pos_w: Float[np.ndarray, "t 19 3"]
    """Joint positions, world frame [m]."""
    body_quat_w: Float[np.ndarray, "t 19 4"]
    """Body orientations, world frame, wxyz."""
    contacts: Bool[np.ndarray, "t 2"] | None = None
    """Foot on the ground, (left, right); None before KP2."""

    @property
    def frame_count(self) -> int:
        return len(self.body_pos_w)

    def pos(self, name: str) -> Float[np.ndarray, "t 3"]:
        """Positions of one body, world frame [m]."""
        return self.body_pos_w[:, _INDEX[name]]

    def both(self, part: str) -> Float[np.ndarray, "t 2 3"]:
        """Positions of a body of both sides (left, right), world frame [m]."""
        return self.body_pos_w[:, [_INDEX[f"{side}_{part}"] for side in FEET]]

    def quat(self, name: str) -> Float[np.ndarray, "t 4"]:
        """Orientations of one body, world frame, wxyz."""
        return self.body_quat_w[:, _INDEX[name]]
