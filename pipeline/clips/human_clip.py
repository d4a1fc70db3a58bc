"""A human motion on the canonical skeleton, whatever file it came from."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series

BODIES: tuple[str, ...] = (
    "pelvis",
    "spine",
    "chest",
    "neck",
    "head",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_toe",
    "right_hip",
    "right_knee",
    "right_ankle",
    "right_toe",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
)
"""Canonical bodies in order. A body's position is that of the joint at its upper end (`left_knee` is
the knee joint and the shank below it, `left_shoulder` the shoulder joint and the upper arm,
`left_toe` the ball of the foot); `chest` is the upper spine, the body that carries neck and arms."""

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

FEET: tuple[str, str] = ("left", "right")

_INDEX = {name: index for index, name in enumerate(BODIES)}


def body(name: str) -> int:
    """Index of a canonical body."""
    return _INDEX[name]


@dataclass(frozen=True, kw_only=True)
class HumanClip:
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

    @property
    def duration_s(self) -> float:
        return self.frame_count / self.fps

    def pos(self, name: str) -> Float[np.ndarray, "t 3"]:
        """Positions of one body, world frame [m]."""
        return self.body_pos_w[:, _INDEX[name]]

    def quat(self, name: str) -> Float[np.ndarray, "t 4"]:
        """Orientations of one body, world frame, wxyz."""
        return self.body_quat_w[:, _INDEX[name]]

    def cut(self, start: int, stop: int, name: str) -> HumanClip:
        """Frames [start, stop) under a new name."""
        return dataclasses.replace(
            self,
            name=name,
            body_pos_w=self.body_pos_w[start:stop].copy(),
            body_quat_w=self.body_quat_w[start:stop].copy(),
            contacts=None if self.contacts is None else self.contacts[start:stop].copy(),
        )

    def resampled(self, fps: float) -> HumanClip:
        """The same motion at another rate, by time; positions linearly, rotations by slerp, contacts from nearest."""
        if fps == self.fps:
            return self
        times_s = time_series.resample_times(self.frame_count, self.fps, fps)
        contacts = self.contacts
        return dataclasses.replace(
            self,
            fps=fps,
            body_pos_w=time_series.resample_linear(self.body_pos_w, self.fps, times_s),
            body_quat_w=time_series.resample_quat(self.body_quat_w, self.fps, times_s),
            contacts=None if contacts is None else time_series.resample_nearest(contacts, self.fps, times_s),
        )
