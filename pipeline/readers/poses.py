"""World poses of a file's joints, for the requested joints and frames; others take no memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.files import page_memory
from pipeline.files.array_file import finite_rows


@runtime_checkable
class Poses(Protocol):
    """T frames of J joints."""

    @property
    def frame_count(self) -> int:
        """T."""
        ...

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions in the file's unit and orientations wxyz of some joints in frames [start, stop), file's world."""
        ...

    def forget(self, stop: int) -> None:
        """Free the memory of the frames before `stop` where that is possible; they are not requested again."""
        ...


@dataclass(frozen=True, kw_only=True)
class TreePoses:
    """Poses of a tree of joints that turn about fixed places in their parents' frames.

    They are worked out from rows of numbers for the requested frames.
    """

    parents: tuple[int, ...]
    """Index of each joint's parent, -1 for the root; a parent comes before its children."""
    offsets: Float[np.ndarray, "j 3"]
    """Place of each joint in its parent's frame, in the file's unit; of the root it is not used."""
    frame_count: int
    local: Callable[[int, int], tuple[np.ndarray, np.ndarray]]
    """Places of the root (t, 3) and orientations wxyz of all joints in their parents' frames (t, j, 4) in frames
    [start, stop)."""
    release: Callable[[int], None]
    """Frees the memory of the frames before one."""

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and orientations of some joints in frames [start, stop)."""
        root, local_quat = self.local(start, min(stop, self.frame_count))
        local_pos = np.broadcast_to(self.offsets, (len(root), *self.offsets.shape)).copy()
        local_pos[:, 0] = root
        pos, quat = forward_kinematics(self.parents, local_pos, local_quat)
        return pos[:, list(joints)], quat[:, list(joints)]

    def forget(self, stop: int) -> None:
        """Free the memory of the frames before `stop`."""
        self.release(stop)


@dataclass(frozen=True, kw_only=True)
class RowPoses:
    """World poses that a file holds, turned into numbers for the requested frames."""

    pos: np.ndarray
    """Positions (t, b, 3) as the file stores them, in its unit."""
    quat: np.ndarray
    """Orientations wxyz (t, b, 4), likewise."""
    columns: tuple[int, ...]
    """Which body each joint is."""

    @property
    def frame_count(self) -> int:
        return len(self.pos)

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and unit orientations of some joints in frames [start, stop)."""
        columns = [self.columns[joint] for joint in joints]
        pos, quat = (finite_rows(each, start, stop)[:, columns] for each in (self.pos, self.quat))
        return pos, rotation.normalize(quat)

    def forget(self, stop: int) -> None:
        """Free the memory of the frames before `stop`."""
        page_memory.forget(self.pos, stop)
        page_memory.forget(self.quat, stop)


@dataclass(frozen=True, kw_only=True)
class TipPoses:
    """Poses with one more joint at the rigid end of some of the joints (a BVH's End Site)."""

    poses: Poses
    count: int
    """Joints of `poses`; the tips come after them."""
    tips: tuple[tuple[int, tuple[float, float, float]], ...]
    """Joint that carries each tip, and the tip's place in its frame in the file's unit."""

    @property
    def frame_count(self) -> int:
        return self.poses.frame_count

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and orientations of some joints and tips in frames [start, stop); a tip turns with its joint."""
        carriers = [each if each < self.count else self.tips[each - self.count][0] for each in joints]
        pos, quat = self.poses.world(carriers, start, stop)
        for column, each in enumerate(joints):
            if each >= self.count:
                place = np.array(self.tips[each - self.count][1])
                pos[:, column] = pos[:, column] + rotation.rotate(quat[:, column], place)
        return pos, quat

    def forget(self, stop: int) -> None:
        """Free the memory of the frames before `stop`."""
        self.poses.forget(stop)


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


def with_ancestors(joints: Sequence[int], parents: Sequence[int]) -> list[int]:
    """The joints and all above them, parents first, in a tree whose parents come before their children."""
    found: set[int] = set()
    for joint in joints:
        while joint >= 0 and joint not in found:
            found.add(joint)
            joint = parents[joint]
    return sorted(found)


CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


@dataclass(frozen=True, kw_only=True)
class ChannelPoses:
    """T rows of channel values of a tree of J joints.

    A position channel replaces that component of the joint's offset; rotations are intrinsic, in the order of the
    channels.
    """

    parents: tuple[int, ...]
    """Index of each joint's parent, -1 for the root; a parent comes before its children."""
    offsets: Float[np.ndarray, "j 3"]
    channels: tuple[tuple[str, ...], ...]
    """Names of each joint's channels (`CHANNELS`), in the order of the columns."""
    values: Float[np.ndarray, "t c"]
    """Lengths in the file's unit and angles [deg]."""

    @property
    def frame_count(self) -> int:
        return len(self.values)

    def forget(self, stop: int) -> None:
        """Free the memory of the frames before `stop`, which are not requested again."""
        page_memory.forget(self.values, stop)

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and orientations of some joints in frames [start, stop)."""
        needed = with_ancestors(joints, self.parents)
        local_pos, local_quat = self._local(needed, self.values[start:stop])
        pos: dict[int, np.ndarray] = {}
        quat: dict[int, np.ndarray] = {}
        for column, joint in enumerate(needed):
            parent = self.parents[joint]
            if parent < 0:
                pos[joint], quat[joint] = local_pos[column], local_quat[column]
            else:
                pos[joint] = pos[parent] + rotation.rotate(quat[parent], local_pos[column])
                quat[joint] = rotation.multiply(quat[parent], local_quat[column])
        return np.stack([pos[joint] for joint in joints], axis=1), np.stack([quat[joint] for joint in joints], axis=1)

    def _local(
        self, joints: list[int], values: Float[np.ndarray, "t c"]
    ) -> tuple[Float[np.ndarray, "n t 3"], Float[np.ndarray, "n t 4"]]:
        """Place and orientation of joints in their parents' frames; joints of the same channels are done together."""
        frames = len(values)
        pos = np.broadcast_to(self.offsets[joints][:, None], (len(joints), frames, 3)).copy()
        quat = np.broadcast_to(rotation.IDENTITY, (len(joints), frames, 4)).copy()
        starts = np.cumsum([0, *(len(each) for each in self.channels)])
        for channels in sorted({self.channels[joint] for joint in joints}):
            group = [column for column, joint in enumerate(joints) if self.channels[joint] == channels]
            first = starts[[joints[column] for column in group]]
            turns = []
            for place, channel in enumerate(channels):
                column, axis = values[:, first + place].T, CHANNELS.index(channel) % 3
                if channel.endswith("position"):
                    pos[group, :, axis] = column
                else:
                    turns.append((axis, np.deg2rad(column)))
            if turns:
                quat[group] = rotation.from_euler(turns)
        return pos, quat
