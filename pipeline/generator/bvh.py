"""A motion as BVH text: centimetres, degrees, y up, facing +z, T-pose at rest.

The root turns by Y, X, Z so that no heading is singular, all other joints by Z, Y, X so that neither a
knee bent by more than a right angle nor a hanging arm is. Rotations multiply in the order of the channels.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pipeline.generator import skeleton
from pipeline.generator.skeleton import Motion

CM_PER_M = 100.0
ROOT_ORDER, JOINT_ORDER = "YXZ", "ZYX"
DECIMALS = 4
"""Decimals of degrees and centimetres: 2 micrometres at a metre's distance."""


def channels(motion: Motion) -> Float[np.ndarray, "t c"]:
    """The motion block: root position [cm], then the angles of every joint in `skeleton.JOINTS` [deg]."""
    columns = [_to_y_up(motion.root_pos_w) * CM_PER_M]
    for joint in skeleton.JOINTS:
        order = ROOT_ORDER if joint.parent is None else JOINT_ORDER
        columns.append(_angles_deg(motion.local_quat(joint), order))
    return np.round(np.concatenate(columns, axis=1), DECIMALS) + 0.0


def columns_of(name: str) -> slice:
    """Columns of a joint's three angles in the motion block."""
    index = [joint.name for joint in skeleton.JOINTS].index(name)
    return slice(3 + 3 * index, 6 + 3 * index)


def to_text(block: Float[np.ndarray, "t c"], fps: float) -> str:
    """A BVH file of this skeleton with the given motion block, at a rate [Hz]."""
    lines = ["HIERARCHY", *_hierarchy("Hips", 0), "MOTION", f"Frames: {len(block)}", f"Frame Time: {1.0 / fps:.9f}"]
    lines += [" ".join([_number(value) for value in row]) for row in block.tolist()]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    """Fixed decimals without trailing zeros."""
    return f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")


def _to_y_up(vectors: np.ndarray) -> np.ndarray:
    """(x, y, z) with x forward, z up -> (left, up, forward), the axes of the file."""
    return vectors[..., [1, 2, 0]]


def _angles_deg(quat: np.ndarray, order: str) -> Float[np.ndarray, "t 3"]:
    """Angles about the file's axes, multiplied in `order`, without jumps of 360 degrees [deg]."""
    xyzw = np.concatenate([_to_y_up(quat[:, 1:]), quat[:, :1]], axis=-1)
    return np.rad2deg(np.unwrap(Rotation.from_quat(xyzw).as_euler(order), axis=0))


def _hierarchy(name: str, depth: int) -> list[str]:
    joint = next(joint for joint in skeleton.JOINTS if joint.name == name)
    pad, inner = "  " * depth, "  " * (depth + 1)
    order = ROOT_ORDER if joint.parent is None else JOINT_ORDER
    turns = " ".join(f"{axis}rotation" for axis in order)
    root = joint.parent is None
    lines = [f"{pad}{'ROOT' if root else 'JOINT'} {name}", f"{pad}{{", f"{inner}OFFSET {_offset(joint.offset)}"]
    lines.append(f"{inner}CHANNELS {f'6 Xposition Yposition Zposition {turns}' if root else f'3 {turns}'}")
    for child in skeleton.JOINTS:
        if child.parent == name:
            lines += _hierarchy(child.name, depth + 1)
    if joint.end is not None:
        lines += [f"{inner}End Site", f"{inner}{{", f"{inner}  OFFSET {_offset(joint.end)}", f"{inner}}}"]
    return [*lines, f"{pad}}}"]


def _offset(offset_m: tuple[float, float, float]) -> str:
    return " ".join(f"{value * CM_PER_M:.6f}" for value in (offset_m[1], offset_m[2], offset_m[0]))
