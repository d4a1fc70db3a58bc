"""Axes of the bodies measured from a skeleton's rest pose, whatever it is: a T, an A, hanging or forward arms.

In the rest pose all joints' frames are parallel. Up is from the hips to the head, left from the right hip to the left
one; a limb's axis is its bone, and its other axes are those that a person's limb has who moves it there from a stance
with hanging arms: an arm that is raised to the side keeps its forward axis, one that is raised ahead its left axis.
"""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, FEET
from pipeline.readers.raw_motion import TIP, RawMotion
from pipeline.readers.roles import Roles
from pipeline.readers.skeleton_map import BodyMap, SkeletonMap

NAME = "by_structure"
"""Name of a map that was measured."""

UPRIGHT = 0.8
"""Cosine to the vertical that both legs have in a rest pose in which a person could stand."""
SNAP = np.cos(np.deg2rad(15.0))
"""An axis of the rest pose this close to one of the file's is that one."""
ALONG = np.cos(np.deg2rad(30.0))
"""An arm this close to the forward axis is raised ahead."""
TOE_FROM_ANKLE = (0.13, 0.0, -0.045)
"""Ball of the foot from the ankle in the foot's frame [m] where a skeleton has none."""


def standing_axes(motion: RawMotion, roles: Roles) -> Float[np.ndarray, "3 3"] | None:
    """Columns ahead, left, up of a person in the rest pose; None where no person could stand so.

    Where a rest pose is none (bones one after another along an axis), nothing can be measured from it.
    """
    place = rest_places(motion)
    hips, ankles = ([place[roles.joints[f"{side}_{part}"]] for side in FEET] for part in ("hip", "ankle"))
    left = hips[0] - hips[1]
    up = place[roles.joints["head"]] - 0.5 * (hips[0] + hips[1])
    if min(np.linalg.norm(left), np.linalg.norm(up)) < 1e-9:
        return None
    left, up = _snapped(rotation.normalize(left)), _snapped(rotation.normalize(up))
    if abs(float(left @ up)) > 0.3:
        return None
    left = rotation.normalize(left - up * (left @ up))
    legs = rotation.normalize(np.array([ankle - hip for hip, ankle in zip(hips, ankles, strict=True)]))
    if (legs @ up).max() > -UPRIGHT:
        return None
    shoulders = place[roles.joints["left_shoulder"]] - place[roles.joints["right_shoulder"]]
    if float(shoulders @ left) <= 0.0:
        return None
    return np.column_stack([np.cross(left, up), left, up])


def rest_places(motion: RawMotion) -> Float[np.ndarray, "j 3"]:
    """Place of every joint in the rest pose, in the file's unit."""
    place = np.zeros((len(motion.parents), 3))
    for joint, parent in enumerate(motion.parents):
        place[joint] = motion.rest_offset[joint] + (place[parent] if parent >= 0 else 0.0)
    return place


def measured_map(motion: RawMotion, roles: Roles) -> tuple[SkeletonMap, RawMotion] | None:
    """A map measured from the rest pose, and the motion with the ends of bones that it needs as joints.

    None where the rest pose is none that a person could stand in, or a hand is missing.
    """
    axes = standing_axes(motion, roles)
    if axes is None:
        return None
    names = {body: motion.joint_names[joint] for body, joint in roles.joints.items()}
    ends = []
    for body, carrier in _missing_ends(roles):
        if names[carrier] in motion.tips:
            ends.append(names[carrier])
            names[body] = f"{names[carrier]}{TIP}"
        elif not body.endswith("toe"):
            return None
    motion = motion.with_tips(tuple(dict.fromkeys(ends)))
    place = dict(zip(motion.joint_names, rest_places(motion), strict=True))
    bodies = {body: _body(body, names, place, axes) for body in BODIES}
    title = "measured from the rest pose of the file"
    return SkeletonMap(name=NAME, title=title, bodies=bodies), motion


def _missing_ends(roles: Roles) -> list[tuple[str, str]]:
    pairs = {
        f"{side}_{end}": f"{side}_{joint}" for side in FEET for end, joint in (("toe", "ankle"), ("wrist", "elbow"))
    }
    return [(end, carrier) for end, carrier in pairs.items() if end in roles.missing]


def _body(body: str, names: dict[str, str], place: dict[str, np.ndarray], axes: Float[np.ndarray, "3 3"]) -> BodyMap:
    """One body's axes in the rest pose."""
    ahead, left, up = axes.T
    side, _, part = body.partition("_")
    if part in ("ankle", "toe"):
        foot = _foot_ahead(place, names, side, axes)
        if body not in names:
            carrier = names[f"{side}_ankle"]
            return BodyMap(joint=carrier, ahead=_text(foot), up=_text(up), offset=TOE_FROM_ANKLE)
        return BodyMap(joint=names[body], ahead=_text(foot), up=_text(up))
    if not part:
        return BodyMap(joint=names[body], up=_text(up), left=_text(left))
    child = {"hip": "knee", "knee": "ankle", "shoulder": "elbow", "elbow": "wrist"}.get(part)
    upper, lower = (f"{side}_elbow", f"{side}_wrist") if child is None else (body, f"{side}_{child}")
    bone = rotation.normalize(place[names[lower]] - place[names[upper]])
    down = names[lower] if child is not None else _text(bone)
    if part in ("hip", "knee") or abs(float(bone @ ahead)) > ALONG:
        return BodyMap(joint=names[body], down=down, left=_text(left))
    return BodyMap(joint=names[body], down=down, ahead=_text(ahead))


def _foot_ahead(
    place: dict[str, np.ndarray], names: dict[str, str], side: str, axes: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, " 3"]:
    """Where a foot points at rest: ahead, or where its toe is if that is turned out by more than 15 degrees."""
    ahead, _, up = axes.T
    if f"{side}_toe" not in names:
        return ahead
    bone = place[names[f"{side}_toe"]] - place[names[f"{side}_ankle"]]
    level = bone - up * (bone @ up)
    if float(np.linalg.norm(level)) < 1e-9:
        return ahead
    level = level / np.linalg.norm(level)
    return level if np.cos(np.deg2rad(60.0)) < float(level @ ahead) < SNAP else ahead


def _snapped(direction: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < SNAP:
        return direction
    return np.sign(direction[axis]) * np.eye(3)[axis]


def _text(direction: Float[np.ndarray, " 3"]) -> str:
    """A direction as a map writes it."""
    for axis, sign in itertools.product(range(3), (1.0, -1.0)):
        if np.array_equal(direction, sign * np.eye(3)[axis]):
            return f"{'-' if sign < 0 else ''}{'xyz'[axis]}"
    return " ".join(repr(float(value)) for value in direction)
