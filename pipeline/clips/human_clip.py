"""A human motion on the canonical skeleton, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline.clips.frames import Frames

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

    def quat(self, name: str) -> Float[np.ndarray, "t 4"]:
        """Orientations of one body, world frame, wxyz."""
        return self.body_quat_w[:, _INDEX[name]]
