"""The figure's motion as glTF 2.0, written with struct and json; joints' frames are turned at random."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tests.factories.motion_files import JOINTS, NAMES, Poses, world


def write_gltf(
    path: Path,
    poses: Poses,
    *,
    fps: float = 30.0,
    names: dict[str, str] | None = None,
    prefix: str = "mixamorig:",
    scale: float = 1.0,
    skin: bool = True,
    seed: int = 1,
    rest_is_first_frame: bool = False,
    change=lambda value: value,
) -> Path:
    """A `.glb`, or a `.gltf` with its buffer inside, by the path's suffix.

    Args:
        scale: of an armature node above the hips; the joints' lengths are divided by it
        skin: with a skin whose bind pose is the figure's T pose
        seed: of the turns of the joints' frames against the T pose; 0 for none
        rest_is_first_frame: the nodes stand as in the first frame, not in the bind pose
        change: applied to the JSON before it is written
    """
    turns = (
        Rotation.random(len(NAMES), random_state=seed).as_matrix() if seed else np.tile(np.eye(3), (len(NAMES), 1, 1))
    )
    _, turn_w = world(poses)
    data, views, accessors = bytearray(), [], []

    def stored(values: np.ndarray, kind: str) -> int:
        raw = np.ascontiguousarray(values, dtype="<f4").tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(values), "type": kind})
        data.extend(raw)
        return len(accessors) - 1

    times = stored(np.arange(poses.frames) / fps, "SCALAR")
    nodes: list[dict] = [{"name": "Armature", "children": [1], "scale": [scale] * 3}]
    samplers, channels = [], []

    def channel(node: int, what: str, values: np.ndarray) -> None:
        samplers.append({"input": times, "output": stored(values, "VEC4" if what == "rotation" else "VEC3")})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": what}})

    bind = np.zeros((len(NAMES), 4, 4))
    for index, (name, (parent, offset)) in enumerate(JOINTS.items()):
        above = np.eye(3) if parent is None else turns[NAMES.index(parent)]
        local = np.einsum("ij,tjk->tik", above.T, _local(turn_w, index, parent)) @ turns[index]
        rest = local[0] if rest_is_first_frame else above.T @ turns[index]
        node = {"name": prefix + (names or {}).get(name, name)}
        node["translation"] = (above.T @ np.array(offset) / scale).tolist()
        node["rotation"] = Rotation.from_matrix(rest).as_quat().tolist()
        children = [1 + NAMES.index(child) for child, (of, _) in JOINTS.items() if of == name]
        if children:
            node["children"] = children
        nodes.append(node)
        channel(len(nodes) - 1, "rotation", Rotation.from_matrix(local).as_quat())
        if parent is None:
            node["translation"] = (poses.root[0] / scale).tolist()
            channel(1, "translation", poses.root / scale)
            bind[index, :3, 3] = [0.0, 1.0, 0.0]
        else:
            bind[index, :3, 3] = bind[NAMES.index(parent), :3, 3] + offset
        bind[index, :3, :3], bind[index, 3, 3] = turns[index], 1.0
    value = {"asset": {"version": "2.0"}, "nodes": nodes, "scenes": [{"nodes": [0]}]}
    if skin:
        inverse = np.swapaxes(np.linalg.inv(bind), 1, 2).reshape(-1, 16)
        value["skins"] = [{"joints": list(range(1, len(nodes))), "inverseBindMatrices": stored(inverse, "MAT4")}]
    value |= {"animations": [{"name": "walk", "samplers": samplers, "channels": channels}]}
    value |= {"bufferViews": views, "accessors": accessors, "buffers": [{"byteLength": len(data)}]}
    value = change(value)
    if path.suffix == ".gltf":
        value["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(bytes(data)).decode()
        path.write_text(json.dumps(value))
        return path
    text = json.dumps(value).encode()
    text += b" " * (-len(text) % 4)
    data.extend(bytes(-len(data) % 4))
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + bytes(data)
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
    return path


def _local(turn_w: np.ndarray, index: int, parent: str | None) -> np.ndarray:
    """Rotation of a joint in its parent's frame, both as in the T pose (t, 3, 3)."""
    if parent is None:
        return turn_w[:, index]
    return np.swapaxes(turn_w[:, NAMES.index(parent)], 1, 2) @ turn_w[:, index]
