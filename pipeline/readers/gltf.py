"""Skeletal animations of glTF 2.0: joints as nodes, keys as samplers, the rest pose from the skin.

The exporting program chooses the joints' frames in a glTF. Here they are rotated so that all are parallel in the bind
pose, as in a BVH, for the detection of the skeleton. Keys are sampled at their own rate.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import finite_rows
from pipeline.readers.bvh import MAX_DEPTH, MAX_JOINTS
from pipeline.readers.gltf_file import GltfFile, open_gltf
from pipeline.readers.raw_motion import Poses, RawMotion, World, along_tree
from pipeline.readers.text_file import MAX_FRAMES
from pipeline.readers.velocity_rate import STANDARD_HZ

SPARSE_HZ = 20.0
"""Rate below which keys are poses to interpolate between; these are sampled at `SAMPLED_HZ`."""
SAMPLED_HZ = 30.0
UNEVEN = 0.01
"""Largest deviation of the distance between keys, as a share of it."""
ROUND = 0.005
"""Relative deviation up to which a rate is rounded to a standard one, since keys are stored in single precision."""
MAX_SHEAR = 0.05
"""Largest cosine between two axes of a matrix that counts as a rotation."""


@dataclass(frozen=True, kw_only=True)
class Track:
    """Keys of one property of a node."""

    times: Float[np.ndarray, " k"]
    """[s]"""
    values: np.ndarray
    """Values of the keys (k, d), as stored in the file."""
    step: bool
    """Whether a value is held until the next key (interpolation STEP)."""
    turns: bool
    """Whether the values are quaternions xyzw."""

    def at(self, times: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t d"]:
        """Interpolate at `times` [s]: linearly, rotations by slerp, constant before the first and after the last
        key."""
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
        """Free the memory of keys that are not needed from this time onward."""
        page_memory.forget(self.values, int(np.searchsorted(self.times, time, side="right")) - 1)


@dataclass(frozen=True, kw_only=True)
class Node:
    """A node that is a joint or an ancestor of one."""

    name: str
    parent: int
    """Index among the nodes that are kept, -1 for a root."""
    place: Float[np.ndarray, " 3"]
    quat: Float[np.ndarray, " 4"]
    """wxyz"""
    scale: float
    tracks: dict[str, Track]

    def sampled(self, name: str, rest: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Values of a property at `times` [s]; its rest value if it is not animated."""
        return self.tracks[name].at(times) if name in self.tracks else np.repeat(rest[None], len(times), axis=0)


@dataclass(frozen=True, kw_only=True)
class NodePoses(Poses):
    """World poses of nodes, computed for the requested ones; a row is a time [s]."""

    nodes: tuple[Node, ...]
    scale: Float[np.ndarray, " j"]
    """Scale of the world of each node's children."""
    bind_quat: Float[np.ndarray, "j 4"]
    """Orientation of each node's frame in the bind pose, wxyz."""
    shared: bool
    """Whether several properties share the keys' bytes in the file."""

    def forget(self, stop: int) -> None:
        """Free the memory of the keys that are before frame `stop`."""
        for node in self.nodes if stop < self.frame_count and not self.shared else ():
            for track in node.tracks.values():
                track.forget(float(self.rows[0][stop]))

    def world(self, joints: Sequence[int], start: int, stop: int) -> World:
        times = self.rows[0][start:stop]

        def local(index: int) -> tuple[np.ndarray, np.ndarray]:
            node = self.nodes[index]
            place = node.sampled("translation", node.place, times)
            quat = rotation.normalize(node.sampled("rotation", node.quat[[1, 2, 3, 0]], times)[:, [3, 0, 1, 2]])
            return (place * self.scale[node.parent] if node.parent >= 0 else place), quat

        pos, quat = along_tree(joints, [node.parent for node in self.nodes], local)
        return pos, rotation.multiply(quat, rotation.conjugate(self.bind_quat[list(joints)]))


def read_gltf(path: Path) -> RawMotion:
    """The animation of the largest skeleton in a glTF. Raises FileError."""
    file = open_gltf(path)
    joints = _joints(file)
    animation, notes = _animation(file, joints)
    nodes, index = _nodes(file, joints, animation)
    times, rate, sampled = _times(path, nodes)
    scale = np.ones(len(nodes))
    for number, node in enumerate(nodes):
        scale[number] = node.scale * (scale[node.parent] if node.parent >= 0 else 1.0)
    place, quat = _bind_pose(file, nodes, index, scale)
    parents = tuple(node.parent for node in nodes)
    above = place[[max(parent, 0) for parent in parents]]
    return RawMotion(
        format="gltf",
        joint_names=tuple(node.name for node in nodes),
        parents=parents,
        rest_offset=place - above,
        poses=NodePoses(nodes=nodes, scale=scale, bind_quat=quat, rows=(times,), shared=_shared(nodes)),
        fps=rate,
        files=(path,),
        notes=notes + sampled,
    )


def _joints(file: GltfFile) -> list[int]:
    """Indices of the skeleton's nodes: of the skin with most joints, or all nodes without a skin."""
    skins = [each.get("joints", []) for each in file.items("skins")]
    count = len(file.items("nodes"))
    joints = max(skins, key=len) if skins else list(range(count))
    listed = isinstance(joints, list) and all(isinstance(each, int) and 0 <= each < count for each in joints)
    if not joints or not listed:
        raise FileError(file.path, "there is no skeleton: no skin with joints and no nodes.")
    if len(joints) > MAX_JOINTS:
        raise FileError(file.path, f"more than {MAX_JOINTS} joints.")
    return joints


def _animation(file: GltfFile, joints: list[int]) -> tuple[dict[str, Any], tuple[Reason, ...]]:
    """The animation of most joints (in a tie with most channels), and a note on the others."""
    wanted = set(joints)
    moving = []
    for each in file.items("animations"):
        channels = [
            one for one in each.get("channels", []) if isinstance(one, dict) and isinstance(one.get("target"), dict)
        ]
        moved = {one["target"].get("node") for one in channels if isinstance(one["target"].get("node"), int)}
        if moved & wanted:
            moving.append((len(moved & wanted), {**each, "channels": channels}))
    if not moving:
        raise FileError(file.path, "no animation moves the skeleton.", "Export it with its animation.")
    best = max(moving, key=lambda item: item[0])[1]
    if len(moving) == 1:
        return best, ()
    name = str(best.get("name", "without a name"))[:40]
    text = f"the file holds {len(moving)} animations; '{name}', the first of those that move most joints, is read"
    return best, (Reason(code="several_animations", text=text, effect="noted", value=float(len(moving))),)


def _nodes(file: GltfFile, joints: list[int], animation: dict[str, Any]) -> tuple[tuple[Node, ...], list[int]]:
    """The joints and their ancestors, parents first, and their indices in the file."""
    every = file.items("nodes")
    parent = {}
    for number, node in enumerate(every):
        for child in node.get("children", []):
            if not isinstance(child, int) or not 0 <= child < len(every) or child in parent or child == number:
                raise FileError(file.path, f"nodes[{number}] has a child that is not there, or that has two parents.")
            parent[child] = number
    order: list[int] = []
    for joint in joints:
        line = [joint]
        while line[-1] in parent:
            line.append(parent[line[-1]])
            if len(line) > MAX_DEPTH:
                raise FileError(file.path, f"the hierarchy is deeper than {MAX_DEPTH} nodes.")
        order += [each for each in reversed(line) if each not in order]
    tracks = _tracks(file, animation, set(order))
    names: set[str] = set()
    nodes = []
    for each in order:
        place, quat, scale = _transform(file, every[each], each)
        name = str(every[each].get("name") or f"node_{each}")[:100]
        name = name if name not in names else f"{name} ({each})"
        names.add(name)
        above = order.index(parent[each]) if each in parent else -1
        nodes.append(Node(name=name, parent=above, place=place, quat=quat, scale=scale, tracks=tracks.get(each, {})))
    return tuple(nodes), order


def _transform(file: GltfFile, node: dict[str, Any], number: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Position, orientation wxyz and scale of a node at rest. Raises FileError for a scale that is not uniform."""
    try:
        if "matrix" in node:
            matrix = np.array(node["matrix"], dtype=float).reshape(4, 4).T
            place, scale = matrix[:3, 3], np.linalg.norm(matrix[:3, :3], axis=0)
            quat = _turn(file.path, matrix[:3, :3] / np.maximum(scale, 1e-12), f"nodes[{number}]")
        else:
            place = np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=float).reshape(3)
            quat = rotation.normalize(np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), dtype=float).reshape(4))
            quat, scale = quat[[3, 0, 1, 2]], np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=float).reshape(3)
    except (ValueError, TypeError) as error:
        raise FileError(file.path, f"nodes[{number}] has no transform that can be read.") from error
    if not np.isfinite(np.concatenate([place, quat, scale])).all() or scale.min() <= 0.0:
        raise FileError(file.path, f"nodes[{number}] has a transform that is not finite, or a scale of zero or less.")
    if np.ptp(scale) > 0.02 * scale.max():
        raise FileError(file.path, f"nodes[{number}] is scaled differently along its axes.", "Apply its scale.")
    return place, quat, float(scale.mean())


def _turn(path: Path, matrix: np.ndarray, what: str) -> np.ndarray:
    """Quaternions wxyz (..., 4) of matrices (..., 3, 3) with unit columns. Raises FileError for a shear or mirror."""
    square = np.swapaxes(matrix, -1, -2) @ matrix
    if not np.abs(square - np.eye(3)).max(initial=0.0) < MAX_SHEAR or not (np.linalg.det(matrix) > 0.0).all():
        raise FileError(path, f"{what} is no rotation: it is sheared or mirrored.", "Apply it and export again.")
    return rotation.from_matrix(matrix)


def _tracks(file: GltfFile, animation: dict[str, Any], nodes: set[int]) -> dict[int, dict[str, Track]]:
    """Translation and rotation tracks of the given nodes."""
    samplers, tracks, found = animation.get("samplers", []), {}, dict[str, np.ndarray]()
    for channel in animation["channels"]:
        node, what = channel["target"].get("node"), channel["target"].get("path")
        if node not in nodes or what not in ("translation", "rotation"):
            continue
        number = channel.get("sampler")
        if not isinstance(samplers, list) or not isinstance(number, int) or not 0 <= number < len(samplers):
            raise FileError(file.path, f"an animation's channel has no sampler {str(number)[:20]}.")
        sampler = samplers[number]
        key = str(sampler.get("input"))
        if key not in found:
            found[key] = file.numbers(sampler.get("input"))[:, 0]
        times, values = found[key], file.stored(sampler.get("output"))
        kind = sampler.get("interpolation", "LINEAR")
        if kind == "CUBICSPLINE":
            values = values[1::3]  # without in- and out-tangents
        width = 4 if what == "rotation" else 3
        if values.shape != (len(times), width) or not (np.diff(times) > 0.0).all():
            problem = f"the keys of nodes[{node}] ({what}) do not fit their times, or their times do not rise."
            raise FileError(file.path, problem)
        tracks.setdefault(node, {})[what] = Track(
            times=times, values=values, step=kind == "STEP", turns=what == "rotation"
        )
    return tracks


def _shared(nodes: tuple[Node, ...]) -> bool:
    """Whether keys of two properties overlap in memory."""
    tracks = [track.values for node in nodes for track in node.tracks.values()]
    spans = sorted(np.lib.array_utils.byte_bounds(values) for values in tracks)
    return any(stop > start for (_, stop), (start, _) in itertools.pairwise(spans))


def _times(path: Path, nodes: tuple[Node, ...]) -> tuple[np.ndarray, float, tuple[Reason, ...]]:
    """Times of the frames [s], their rate [Hz], and a note if there is not one key per frame."""
    every = [track.times for node in nodes for track in node.tracks.values()]
    if not every:
        raise FileError(path, "no animation moves the skeleton.", "Export it with its animation.")
    densest = max(every, key=len)
    start, stop = min(float(each[0]) for each in every), max(float(each[-1]) for each in every)
    steps = np.diff(densest)
    step = float(np.median(steps)) if len(steps) else 0.0
    rate = 1.0 / step if step > 0.0 else 0.0
    near = [each for each in STANDARD_HZ if abs(each - rate) < ROUND * each]
    rate = float(near[0]) if near else rate
    even = len(steps) > 0 and float(np.abs(steps - step).max()) <= UNEVEN * step + 1e-5
    notes: tuple[Reason, ...] = ()
    if not even or rate < SPARSE_HZ:
        rate = max(rate, SAMPLED_HZ) if rate < 1000.0 else SAMPLED_HZ
        text = f"the keys of the animation are not one each frame; it is sampled at {rate:g} Hz, linearly between keys"
        notes = (Reason(code="sampled_keys", text=text, effect="noted", value=rate, unit="Hz"),)
    count = round((stop - start) * rate) + 1
    if not 1.0 <= rate <= 10_000.0 or count > MAX_FRAMES:
        raise FileError(path, f"{count} frames at {rate:g} Hz are more than the {MAX_FRAMES} allowed.")
    return start + np.arange(count) / rate, rate, notes


def _bind_pose(
    file: GltfFile, nodes: tuple[Node, ...], index: list[int], scale: Float[np.ndarray, " j"]
) -> tuple[Float[np.ndarray, "j 3"], Float[np.ndarray, "j 4"]]:
    """World positions and orientations wxyz of the nodes in the skin's bind pose, or in the rest pose without one."""

    def local(index: int) -> tuple[np.ndarray, np.ndarray]:
        node = nodes[index]
        above = scale[node.parent] if node.parent >= 0 else 1.0
        return node.place[None] * above, node.quat[None]

    (place,), (quat,) = along_tree(range(len(nodes)), [node.parent for node in nodes], local)
    skin = max(file.items("skins"), key=lambda each: len(each.get("joints", [])), default={})
    if "inverseBindMatrices" not in skin:
        return place, quat
    matrices = file.numbers(skin["inverseBindMatrices"])
    joints = [index.index(each) for each in skin["joints"]]
    if matrices.shape != (len(joints), 16) or not np.isfinite(matrices).all():
        raise FileError(file.path, "the skin has not one bind matrix for each joint.")
    inverse = np.swapaxes(matrices.reshape(-1, 4, 4), 1, 2)
    if (np.abs(np.linalg.det(inverse[:, :3, :3])) < 1e-12).any():
        raise FileError(file.path, "a bind matrix of the skin has no inverse.")
    bind = np.linalg.inv(inverse)
    lengths = np.linalg.norm(bind[:, :3, :3], axis=1)
    bind_place = bind[:, :3, 3]
    bind_quat = _turn(file.path, bind[:, :3, :3] / lengths[:, None, :], "a bind matrix of the skin")
    # in the world's scale: a skin may be in another unit than its nodes
    row = {joint: number for number, joint in enumerate(joints)}
    pairs = [(joint, nodes[joint].parent) for joint in joints if nodes[joint].parent in row]
    world = sum(float(np.linalg.norm(place[joint] - place[parent])) for joint, parent in pairs)
    bound = sum(float(np.linalg.norm(bind_place[row[joint]] - bind_place[row[parent]])) for joint, parent in pairs)
    ratio = world / bound if world > 0.0 and bound > 0.0 else 1.0
    origin = place[joints[0]] - ratio * bind_place[row[joints[0]]]
    for joint in joints:
        place[joint], quat[joint] = origin + ratio * bind_place[row[joint]], bind_quat[row[joint]]
    return place, quat
