"""World poses of joints from the channels of a BVH, worked out for the joints and frames that are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.files import page_memory
from pipeline.readers.poses import with_ancestors

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
        """Free the memory of the frames before `stop`, which nobody asks for again."""
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
