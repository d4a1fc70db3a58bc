"""What a format's reader hands over: named joints in the file's own unit and axes, over time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason

MIN_FRAMES = 2
"""A file with fewer frames holds a pose, not a motion."""


def counted(frames: int) -> str:
    """`1 frame`, `12 frames`."""
    return "1 frame" if frames == 1 else f"{frames} frames"


@dataclass(frozen=True, kw_only=True)
class RawMotion:
    """T frames of a tree of J joints; lengths in the file's unit, axes as in the file.

    `rest_offset` holds each joint's place in its parent's frame at rest; skeleton maps take bone
    directions and lengths from it. Missing samples are NaN.
    """

    format: str
    """Name of the file format: `bvh`, `amc`, …"""
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    """Index of each joint's parent, -1 for a root; a parent comes before its children."""
    rest_offset: Float[np.ndarray, "j 3"]
    joint_pos_w: Float[np.ndarray, "t j 3"]
    """Joint positions in the file's world."""
    joint_quat_w: Float[np.ndarray, "t j 4"]
    """Joint orientations in the file's world, wxyz."""
    fps: float | None
    """Frames per second as the file declares [Hz]; None where it does not."""
    assumed_fps: float | None = None
    """The rate that recordings of this kind are known to have [Hz], used when neither file nor person says one."""
    files: tuple[Path, ...]
    """The files that were read, the motion itself first."""
    unit: str | None = None
    """Unit of length where the format defines it (`m`), None where the skeleton has to tell."""
    notes: tuple[Reason, ...] = ()

    def offset_between(self, ancestor: str, joint: str) -> Float[np.ndarray, " 3"]:
        """Rest offset from `ancestor` to `joint` in the ancestor's frame, all joints between at rest.

        Raises KeyError when `joint` does not descend from `ancestor`.
        """
        index, top = self.joint_names.index(joint), self.joint_names.index(ancestor)
        total = np.zeros(3)
        while index != top:
            if index < 0:
                raise KeyError(joint)
            total = total + self.rest_offset[index]
            index = self.parents[index]
        return total


def forward_kinematics(
    parents: tuple[int, ...], local_pos: Float[np.ndarray, "t j 3"], local_quat: Float[np.ndarray, "t j 4"]
) -> tuple[Float[np.ndarray, "t j 3"], Float[np.ndarray, "t j 4"]]:
    """World positions and orientations of a tree of joints from each joint's place in its parent's frame.

    A parent comes before its children; a parent of -1 is the world.
    """
    pos, quat = (
        list(np.moveaxis(local, 1, 0).copy()) for local in (local_pos, local_quat)
    )  # a joint's frames together
    for joint, parent in enumerate(parents):
        if parent >= 0:
            pos[joint] = pos[parent] + rotation.rotate(quat[parent], pos[joint])
            quat[joint] = rotation.multiply(quat[parent], quat[joint])
    return np.stack(pos, axis=1), np.stack(quat, axis=1)
