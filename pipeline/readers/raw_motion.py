"""What a format's reader hands over: named joints in the file's own unit and axes, over time."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.readers.poses import Poses, TipPoses
from pipeline.readers.velocity_rate import VelocityRate

MIN_FRAMES = 2
"""A file with fewer frames holds a pose, not a motion."""

TIP = " (end)"
"""What is added to a joint's name for the end of its bone."""


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
    poses: Poses
    """World poses of the joints."""
    fps: float | None
    """Frames per second as the file declares [Hz]; None where it does not."""
    assumed_fps: float | None = None
    """Known rate of recordings of this kind [Hz], used when neither the file nor a statement gives one."""
    rate_by_velocity: VelocityRate | None = None
    """Rate inferred from the file's own velocities."""
    rate_fault: FileError | None = None
    """What is wrong with the rate that the file declares; raised where no other rate is stated."""
    files: tuple[Path, ...]
    """The files that were read, the motion itself first."""
    unit: str | None = None
    """Unit of length where the format defines it (`m`), None where it is inferred from the skeleton."""
    tips: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """End of a joint's last bone in the joint's frame (a BVH's End Site), for joints that have one."""
    frame_turn: Float[np.ndarray, " 4"] | None = None
    """Rotation wxyz that takes every joint's frame to the one that the map speaks of; None for none."""
    notes: tuple[Reason, ...] = ()

    @property
    def frame_count(self) -> int:
        return self.poses.frame_count

    def world(
        self, joints: Sequence[str], start: int = 0, stop: int | None = None
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and orientations wxyz of some joints in frames [start, stop), in the file's world and unit."""
        columns = [self.joint_names.index(name) for name in joints]
        pos, quat = self.poses.world(columns, start, self.frame_count if stop is None else stop)
        return pos, quat if self.frame_turn is None else rotation.multiply(quat, self.frame_turn)

    @property
    def joint_pos_w(self) -> Float[np.ndarray, "t j 3"]:
        """Positions of all joints in the file's world."""
        return self.world(self.joint_names)[0]

    @property
    def joint_quat_w(self) -> Float[np.ndarray, "t j 4"]:
        """Orientations of all joints in the file's world, wxyz."""
        return self.world(self.joint_names)[1]

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

    def renamed(self, names: tuple[str, ...]) -> RawMotion:
        """The same joints under other names, in the same order."""
        new = dict(zip(self.joint_names, names, strict=True))
        tips = {new[joint]: place for joint, place in self.tips.items()}
        return dataclasses.replace(self, joint_names=names, tips=tips)

    def with_tips(self, joints: Sequence[str]) -> RawMotion:
        """The motion with joints at the ends of some joints' bones, named `<joint> (end)`."""
        if not joints:
            return self
        carriers = [self.joint_names.index(joint) for joint in joints]
        places = [self.tips[joint] for joint in joints]
        poses = TipPoses(poses=self.poses, count=len(self.joint_names), tips=tuple(zip(carriers, places, strict=True)))
        return dataclasses.replace(
            self,
            joint_names=(*self.joint_names, *(f"{joint}{TIP}" for joint in joints)),
            parents=(*self.parents, *carriers),
            rest_offset=np.concatenate([self.rest_offset, np.array(places, dtype=float)]),
            poses=poses,
            tips={},
        )
