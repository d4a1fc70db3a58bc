"""World poses of the nodes of a glTF from the keys of its animation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.files import page_memory
from pipeline.files.array_file import finite_rows
from pipeline.readers.poses import with_ancestors


@dataclass(frozen=True, kw_only=True)
class Track:
    """Keys of one property of a node."""

    times: Float[np.ndarray, " k"]
    """[s]"""
    values: np.ndarray
    """A row (k, d) each key, as the file stores them."""
    step: bool
    """A value is kept until the next key."""
    turns: bool
    """Values are quaternions xyzw."""

    def at(self, times: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t d"]:
        """Values at some times: between keys linearly, rotations by slerp, before the first and after the last kept."""
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, max(len(self.times) - 1, 1))
        if len(self.times) == 1:
            return np.repeat(finite_rows(self.values, 0, 1), len(times), axis=0)
        start, stop = self.times[after - 1], self.times[after]
        share = np.clip((times - start) / np.maximum(stop - start, 1e-9), 0.0, 1.0)
        low, high = (finite_rows(self.values[keys], 0, len(keys)) for keys in (after - 1, after))
        if self.step:
            return np.where((share >= 1.0)[:, None], high, low)
        if not self.turns:
            return low + (high - low) * share[:, None]
        return rotation.slerp(np.roll(low, 1, axis=1), np.roll(high, 1, axis=1), share)[:, [1, 2, 3, 0]]

    def forget(self, time: float) -> None:
        """Free the memory of the keys that no time from this one on needs."""
        page_memory.forget(self.values, int(np.searchsorted(self.times, time, side="right")) - 1)


@dataclass(frozen=True, kw_only=True)
class Node:
    """A node that is a joint, or above one."""

    name: str
    parent: int
    """Index among the nodes that are kept, -1 for a root."""
    place: Float[np.ndarray, " 3"]
    quat: Float[np.ndarray, " 4"]
    """wxyz"""
    scale: float
    tracks: dict[str, Track]


@dataclass(frozen=True, kw_only=True)
class NodePoses:
    """World poses of nodes, worked out for those that are asked for."""

    nodes: tuple[Node, ...]
    scale: Float[np.ndarray, " j"]
    """Scale of the world of each node's children."""
    bind_quat: Float[np.ndarray, "j 4"]
    """Orientation of each node's frame in the bind pose, wxyz."""
    times: Float[np.ndarray, " t"]
    """[s]"""
    shared: bool
    """Whether keys of several properties are the same bytes of the file."""

    @property
    def frame_count(self) -> int:
        return len(self.times)

    def forget(self, stop: int) -> None:
        """Free the memory of the keys that are before frame `stop`."""
        for node in self.nodes if stop < len(self.times) and not self.shared else ():
            for track in node.tracks.values():
                track.forget(float(self.times[stop]))

    def world(
        self, joints: Sequence[int], start: int, stop: int
    ) -> tuple[Float[np.ndarray, "t n 3"], Float[np.ndarray, "t n 4"]]:
        """Positions and orientations of some nodes in frames [start, stop)."""
        times = self.times[start:stop]
        done: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for index in with_ancestors(joints, [node.parent for node in self.nodes]):
            node = self.nodes[index]
            place = _sampled(node, "translation", node.place, times)
            quat = rotation.normalize(_sampled(node, "rotation", node.quat[[1, 2, 3, 0]], times)[:, [3, 0, 1, 2]])
            if node.parent >= 0:
                above, turn = done[node.parent]
                place = above + rotation.rotate(turn, place * self.scale[node.parent])
                quat = rotation.multiply(turn, quat)
            done[index] = place, quat
        found = [done[index] for index in joints]
        pos, quat = np.stack([each[0] for each in found], axis=1), np.stack([each[1] for each in found], axis=1)
        return pos, rotation.multiply(quat, rotation.conjugate(self.bind_quat[list(joints)]))


def _sampled(node: Node, name: str, rest: np.ndarray, times: np.ndarray) -> np.ndarray:
    track = node.tracks.get(name)
    return np.repeat(rest[None], len(times), axis=0) if track is None else track.at(times)
