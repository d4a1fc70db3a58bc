"""Result of a format's reader: named joints over time in the file's unit and axes, with poses computed on request."""

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import finite_rows
from pipeline.readers.velocity_rate import VelocityRate

World = tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]
"""Positions in the file's unit and orientations wxyz of n joints in the file's world."""


@dataclass(frozen=True, kw_only=True)
class Poses(ABC):
    """T frames of J joints."""

    rows: tuple[np.ndarray, ...]
    """Arrays with one row per frame from which the poses are computed."""

    @property
    def frame_count(self) -> int:
        return len(self.rows[0])

    @abstractmethod
    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        """Poses of some joints in frames [start, stop)."""

    def forget(self, stop: int) -> None:
        """Free the memory of the frames before `stop` where that is possible; they are not requested again."""
        for rows in self.rows:
            page_memory.forget(rows, stop)


def along_tree(
    joints: Sequence[int], parents: Sequence[int], local: Callable[[int], tuple[np.ndarray, np.ndarray]]
) -> World:
    """World poses of joints from each joint's position (t, 3) and orientation (t, 4) in its parent's frame
    (`local`)."""
    pos: dict[int, np.ndarray] = {}
    quat: dict[int, np.ndarray] = {}
    for joint in with_ancestors(joints, parents):
        pos[joint], quat[joint] = local(joint)
        parent = parents[joint]
        if parent >= 0:
            pos[joint] = pos[parent] + rotation.rotate(quat[parent], pos[joint])
            quat[joint] = rotation.multiply(quat[parent], quat[joint])
    return np.stack([pos[joint] for joint in joints], axis=1), np.stack([quat[joint] for joint in joints], axis=1)


def in_parents(
    pos: Float[np.ndarray, "t n 3"], quat: Float[np.ndarray, "t n 4"], parents: Sequence[int]
) -> Float[np.ndarray, "t n 3"]:
    """Positions of joints in their parents' frames, zero for a root, from world poses."""
    above = [joint if parent < 0 else parent for joint, parent in enumerate(parents)]
    return rotation.rotate_inverse(quat[:, above], pos - pos[:, above])


def with_ancestors(joints: Sequence[int], parents: Sequence[int]) -> list[int]:
    """The joints and all their ancestors, parents first, in a tree with parents before children."""
    found: set[int] = set()
    for joint in joints:
        while joint >= 0 and joint not in found:
            found.add(joint)
            joint = parents[joint]
    return sorted(found)


def parent_indices(parents: Mapping[str, str | None]) -> tuple[int, ...]:
    """Index of each joint's parent, -1 for a root, of a tree that maps each joint to its parent."""
    order = list(parents)
    return tuple(-1 if parent is None else order.index(parent) for parent in parents.values())


@dataclass(frozen=True, kw_only=True)
class TreePoses(Poses):
    """Poses of a tree of joints with constant offsets in their parents' frames."""

    parents: tuple[int, ...]
    """Index of each joint's parent, -1 for the root; a parent comes before its children."""
    offsets: Float[np.ndarray, "j 3"]
    """Offset of each joint in its parent's frame, in the file's unit; not used for the root."""
    local: Callable[[int, int], tuple[np.ndarray, np.ndarray]]
    """Function for the positions of the root (t, 3) and orientations wxyz of all joints in their parents' frames (t, j,
    4) in frames [start, stop)."""

    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        root, quat = self.local(start, min(stop, self.frame_count))
        offsets = np.broadcast_to(self.offsets, (len(root), *self.offsets.shape))
        return along_tree(
            joints,
            self.parents,
            lambda joint: (offsets[:, joint] if self.parents[joint] >= 0 else root, quat[:, joint]),
        )


@dataclass(frozen=True, kw_only=True)
class RowPoses(Poses):
    """World poses stored in a file, converted for the requested frames.

    `rows` are positions (t, b, 3) in the file's unit and orientations wxyz (t, b, 4), as stored in the file.
    """

    columns: tuple[int, ...]
    """Index of each joint's body."""

    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        columns = [self.columns[joint] for joint in joints]
        pos, quat = (finite_rows(each, start, stop)[:, columns] for each in self.rows)
        return pos, rotation.normalize(quat)


@dataclass(frozen=True, kw_only=True)
class TipPoses(Poses):
    """Poses with one more joint at the rigid end of some of the joints (a BVH's End Site)."""

    poses: Poses
    count: int
    """Number of joints in `poses`; the tips follow."""
    tips: tuple[tuple[int, tuple[float, float, float]], ...]
    """Parent joint of each tip, and the tip's offset in its frame, in the file's unit."""

    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        """Poses of joints and tips; a tip has the orientation of its joint."""
        carriers = [each if each < self.count else self.tips[each - self.count][0] for each in joints]
        pos, quat = self.poses.world(carriers, start, stop)
        for column, each in enumerate(joints):
            if each >= self.count:
                place = np.array(self.tips[each - self.count][1])
                pos[:, column] = pos[:, column] + rotation.rotate(quat[:, column], place)
        return pos, quat

    def forget(self, stop: int) -> None:
        self.poses.forget(stop)


CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


@dataclass(frozen=True, kw_only=True)
class ChannelPoses(Poses):
    """T rows of channel values of a tree of J joints, lengths in the file's unit and angles [deg].

    A position channel replaces that component of the joint's offset; rotations are intrinsic, in the order of the
    channels.
    """

    parents: tuple[int, ...]
    """Index of each joint's parent, -1 for the root; a parent comes before its children."""
    offsets: Float[np.ndarray, "j 3"]
    channels: tuple[tuple[str, ...], ...]
    """Names of each joint's channels (`CHANNELS`), in the order of the columns."""

    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        needed = with_ancestors(joints, self.parents)
        pos, quat = self._local(needed, self.rows[0][start:stop])
        return along_tree(joints, self.parents, lambda joint: (pos[needed.index(joint)], quat[needed.index(joint)]))

    def _local(
        self, joints: list[int], values: Float[np.ndarray, "t c"]
    ) -> tuple[Float[np.ndarray, "n t 3"], Float[np.ndarray, "n t 4"]]:
        """Position and orientation of joints in their parents' frames; joints with equal channels are batched."""
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


MIN_FRAMES = 2
"""Least number of frames of a motion; a file with fewer contains a pose."""

TIP = " (end)"
"""Suffix of a joint's name for the end of its bone."""


def refuse_pose(path: Path, frames: int) -> None:
    """Raise FileError for a file with too few frames."""
    if frames < MIN_FRAMES:
        raise FileError(path, f"the file has {'1 frame' if frames == 1 else f'{frames} frames'}, which is no motion.")


@dataclass(frozen=True, kw_only=True)
class RawMotion:
    """T frames of a tree of J joints; lengths in the file's unit, axes as in the file.

    `rest_offset` is each joint's offset in its parent's frame at rest, from which skeleton maps get bone directions and
    lengths. Missing samples are NaN.
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
    """Frames per second as the file declares [Hz]; None if it does not."""
    assumed_fps: float | None = None
    """Known rate of recordings of this kind [Hz], used when neither the file nor a statement gives one."""
    rate_by_velocity: VelocityRate | None = None
    """Rate inferred from the file's own velocities."""
    rate_fault: FileError | None = None
    """Error in the declared rate; raised if no other rate is stated."""
    files: tuple[Path, ...]
    """The files that were read, the motion itself first."""
    unit: str | None = None
    """Unit of length where the format defines it (`m`), None where it is inferred from the skeleton."""
    tips: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """End of a joint's last bone in the joint's frame (a BVH's End Site), for joints that have one."""
    frame_turn: Float[np.ndarray, " 4"] | None = None
    """Rotation wxyz from every joint's frame to the map's joint frame; None for no rotation."""
    notes: tuple[Reason, ...] = ()

    @property
    def frame_count(self) -> int:
        return self.poses.frame_count

    def world(self, joints: Sequence[str], start: int = 0, stop: int | None = None) -> World:
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
        """Rest offset from `ancestor` to `joint` in the ancestor's frame. Raises KeyError if it is not an ancestor."""
        index, top = self.joint_names.index(joint), self.joint_names.index(ancestor)
        total = np.zeros(3)
        while index != top:
            if index < 0:
                raise KeyError(joint)
            total = total + self.rest_offset[index]
            index = self.parents[index]
        return total

    def renamed(self, names: tuple[str, ...]) -> "RawMotion":
        """The same joints under other names, in the same order."""
        new = dict(zip(self.joint_names, names, strict=True))
        tips = {new[joint]: place for joint, place in self.tips.items()}
        return dataclasses.replace(self, joint_names=names, tips=tips)

    def with_tips(self, joints: Sequence[str]) -> "RawMotion":
        """The motion with joints at the ends of some joints' bones, named `<joint> (end)`."""
        if not joints:
            return self
        carriers = [self.joint_names.index(joint) for joint in joints]
        places = [self.tips[joint] for joint in joints]
        tips = tuple(zip(carriers, places, strict=True))
        poses = TipPoses(rows=self.poses.rows, poses=self.poses, count=len(self.joint_names), tips=tips)
        return dataclasses.replace(
            self,
            joint_names=(*self.joint_names, *(f"{joint}{TIP}" for joint in joints)),
            parents=(*self.parents, *carriers),
            rest_offset=np.concatenate([self.rest_offset, np.array(places, dtype=float)]),
            poses=poses,
            tips={},
        )


NORM_MIN, NORM_MAX = 0.99, 1.01
"""Range of norms of unit quaternions with rounding."""


def check_unit(path: Path, quat: np.ndarray, what: str, first: int = 0) -> None:
    """Check that quaternions (t, ..., 4) of frames from `first` on are unit or NaN. Raises FileError with the frame."""
    norm = np.linalg.norm(quat, axis=-1).reshape(len(quat), -1)
    wrong = np.flatnonzero(((norm < NORM_MIN) | (norm > NORM_MAX)).any(axis=1))
    if len(wrong):
        worst = float(norm[wrong[0]][np.nanargmax(np.abs(norm[wrong[0]] - 1.0))])
        problem = f"{what} at frame {first + wrong[0]} has norm {worst:.3g}, expected {NORM_MIN} to {NORM_MAX}."
        raise FileError(path, problem, "It is not a unit quaternion: check the columns.")
