"""The canonical skeleton as arrays, and poses of bodies in their parents' frames."""

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, PARENT, body

CHILDREN: tuple[tuple[int, ...], ...] = tuple(
    tuple(child for child, parent in enumerate(PARENT) if parent == index) for index in range(len(BODIES))
)

LIMBS: tuple[tuple[int, int, int], ...] = tuple(
    (body(f"{side}_{upper}"), body(f"{side}_{middle}"), body(f"{side}_{lower}"))
    for side in ("left", "right")
    for upper, middle, lower in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
)
"""Upper, middle and lower joint of each limb."""

LIMB_ENDS: tuple[int, ...] = tuple(
    body(f"{side}_{name}") for side in ("left", "right") for name in ("knee", "ankle", "toe", "elbow", "wrist")
)
"""Bodies whose bone to the parent is a single bone in every skeleton, so its length is constant."""

FEET_BODIES: tuple[int, ...] = tuple(body(f"{side}_{name}") for side in ("left", "right") for name in ("ankle", "toe"))

TOES: tuple[int, ...] = tuple(body(f"{side}_toe") for side in ("left", "right"))

KNEES: tuple[int, ...] = tuple(body(f"{side}_knee") for side in ("left", "right"))

LEVERS: dict[str, float] = {
    "pelvis": 1.0,
    "spine": 0.8,
    "chest": 0.65,
    "neck": 0.15,
    "hip": 0.95,
    "knee": 0.55,
    "ankle": 0.15,
    "shoulder": 0.55,
    "elbow": 0.27,
}
"""Distance from a body to the furthest joint below it, if there is one, for a person of 1.75 m [m]."""

LEVER: Float[np.ndarray, " 19"] = np.array([LEVERS.get(name.split("_")[-1], 0.0) for name in BODIES])

Positions = Float[np.ndarray, "t 19 3"]
Orientations = Float[np.ndarray, "t 19 4"]
BodyMask = Bool[np.ndarray, "t 19"]
"""Mask of bodies in each frame."""
FrameMask = Bool[np.ndarray, " t"]
PerBody = Float[np.ndarray, "t 19"]
"""A number for each frame and body."""


def descendants(index: int) -> tuple[int, ...]:
    """Bodies below a body, nearest first."""
    below: list[int] = []
    for child in CHILDREN[index]:
        below += [child, *descendants(child)]
    return tuple(below)


def parent_pose(pos_w: Positions, quat_w: Orientations) -> tuple[Positions, Orientations]:
    """World pose of each body's parent; the world's own for the pelvis."""
    parents = list(PARENT[1:])
    pos, quat = np.zeros_like(pos_w), np.zeros_like(quat_w)
    pos[:, 1:], quat[:, 1:] = pos_w[:, parents], quat_w[:, parents]
    quat[:, 0] = rotation.IDENTITY
    return pos, quat


def to_local(pos_w: Positions, quat_w: Orientations) -> tuple[Positions, Orientations]:
    """Offset [m] and orientation of each body in its parent's frame; the pelvis in the world."""
    parent_pos_w, parent_quat_w = parent_pose(pos_w, quat_w)
    offset = rotation.rotate_inverse(parent_quat_w, pos_w - parent_pos_w)
    return offset, rotation.multiply(rotation.conjugate(parent_quat_w), quat_w)


def bone_lengths(pos_w: Positions) -> Float[np.ndarray, "t 19"]:
    """Distance [m] of each body from its parent; 0 for the pelvis."""
    lengths = np.zeros(pos_w.shape[:2])
    lengths[:, 1:] = rotation.length(pos_w[:, 1:] - pos_w[:, list(PARENT[1:])])
    return lengths
