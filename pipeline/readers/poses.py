"""World poses of a file's joints, for the joints and frames that are asked for: others take no memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pipeline import rotation


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
        """Free the memory of the frames before `stop` where that is possible; nobody asks for them again."""
        ...


@dataclass(frozen=True, kw_only=True)
class StoredPoses:
    """World poses that a reader has worked out, or that the file holds."""

    pos_w: Float[np.ndarray, "t j 3"]
    quat_w: Float[np.ndarray, "t j 4"]
    """wxyz"""

    @property
    def frame_count(self) -> int:
        return len(self.pos_w)

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and orientations of some joints in frames [start, stop)."""
        return self.pos_w[start:stop, list(joints)], self.quat_w[start:stop, list(joints)]

    def forget(self, stop: int) -> None:
        """Keep everything."""


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
