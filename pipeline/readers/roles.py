"""Assign a skeleton's joints to canonical bodies, from their names and the tree.

The alias lists cover the names that Mixamo, Rokoko, Xsens and MotionBuilder, Nokov, OptiTrack Motive, Perception
Neuron, SOMA and Kimodo, 100STYLE, CMU, LAFAN1, Unreal, 3ds Max's Biped, VRM and Rigify give to joints.

The axes of the bodies are measured from a skeleton's rest pose: T-pose, A-pose, hanging or forward arms. In the rest
pose all joints' frames are parallel. Up is from the hips to the head, left from the right hip to the left one. A limb's
axis is its bone; its other axes follow from moving the limb there from hanging arms: an arm that is raised sideways
keeps its forward axis, one that is raised forward its left axis.
"""

import itertools
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, FEET
from pipeline.readers.raw_motion import TIP, RawMotion
from pipeline.readers.skeleton_map import BodyMap, SkeletonMap

SEPARATORS = ":|_-. "

HIP = ("upleg", "upperleg", "thigh", "femur", "hip", "leg")
KNEE = ("lowerleg", "lowleg", "shin", "calf", "tibia", "shank", "knee", "leg")
ANKLE = ("foot", "ankle")
TOE = ("toebase", "toe", "toes", "toe0", "ball", "forefoot")
SHOULDER = ("upperarm", "uparm", "uarm", "humerus", "arm", "shoulder")
ELBOW = ("forearm", "lowerarm", "lowarm", "farm", "radius", "elbow")
WRIST = ("hand", "wrist", "palm")
"""Names of the joint at the upper end of each part of a limb, the most reliable first. `leg` is the thigh of skeletons
with another name for the shank, `shoulder` the upper arm of skeletons without an arm."""

LIMBS = {"hip": HIP, "knee": KNEE, "ankle": ANKLE, "toe": TOE, "shoulder": SHOULDER, "elbow": ELBOW, "wrist": WRIST}
HEADS = ("head", "chead", "spine006")
"""Names of the head; the last two are those of VRM (`C_Head`) and Rigify (`spine.006`)."""

_PARTS = frozenset(alias for aliases in LIMBS.values() for alias in aliases)


def shared_prefix(names: Sequence[str]) -> str:
    """Prefix of all joints except one or two roots, up to a separator: `mixamorig7:`, `Take_01:`, `Character1_`."""
    for skipped in range(min(3, len(names))):
        kept = names[skipped:]
        common = os.path.commonprefix(kept) if len(kept) > 2 else ""  # noqa: RUF071, by characters
        last = max(common.rfind(separator) for separator in SEPARATORS)
        prefix = common[: last + 1]
        if prefix and all(len(name) > len(prefix) for name in kept):
            return prefix
    return ""


def without_prefix(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names without their shared prefix; unchanged if that would make two of them equal."""
    prefix = shared_prefix(names)
    bare = tuple(name.removeprefix(prefix) for name in names)
    return bare if len(set(bare)) == len(names) else names


def side_and_part(name: str) -> tuple[str, str]:
    """`left`, `right` or empty, and the rest of a name in lower case without separators."""
    words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", name)
    flat = "".join(words).lower()
    for side in ("left", "right"):
        if flat.startswith(side):
            return side, flat.removeprefix(side)
        if flat.endswith(side):
            return side, flat.removesuffix(side)
    lower = [word.lower() for word in words]
    for side in ("left", "right"):
        for rest in (lower[1:] if lower[:1] == [side[0]] else [], lower[:-1] if lower[-1:] == [side[0]] else []):
            if rest:
                return side, "".join(rest)
        if flat.startswith(side[0]) and flat[1:] in _PARTS:
            return side, flat[1:]
    return "", flat


NO_BONE = 1e-6
"""Share of the leg length below which a joint is at its parent's position."""


@dataclass(frozen=True, kw_only=True)
class Roles:
    """Joints of canonical bodies by index."""

    joints: Mapping[str, int]
    """Canonical body -> joint. A toe or a wrist may be missing; `spine` and `neck` may share a joint with another."""
    missing: tuple[str, ...]
    """Bodies for which no joint was found."""
    faults: tuple[str, ...]
    """Contradictions between tree and names, as phrases."""

    @property
    def complete(self) -> bool:
        """Whether every body except toes and wrists has a joint, and the tree agrees."""
        return not self.faults and all(body.endswith(("toe", "wrist")) for body in self.missing)


def find_roles(names: Sequence[str], parents: Sequence[int], rest_offset: Float[np.ndarray, "j 3"]) -> Roles:
    """The joint of each canonical body in a tree whose parents come before their children."""
    limbs = _limbs(names, parents)
    joints, faults = dict(limbs), []
    for side in FEET:
        for chain in (("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist")):
            line = [f"{side}_{part}" for part in chain if f"{side}_{part}" in limbs]
            for upper, lower in itertools.pairwise(line):
                if limbs[upper] not in _ancestors(parents, limbs[lower]):
                    faults.append(f"'{names[limbs[lower]]}' does not descend from '{names[limbs[upper]]}'")
    head = _head(names, parents)
    hips, shoulders = (
        [limbs[f"{side}_{part}"] for side in FEET if f"{side}_{part}" in limbs] for part in ("hip", "shoulder")
    )
    found = {
        "head": head,
        "pelvis": _common(parents, hips) if len(hips) == 2 else None,
        "chest": _common(parents, [*shoulders, head]) if len(shoulders) == 2 and head is not None else None,
    }
    joints |= {body: joint for body, joint in found.items() if joint is not None}
    if {"pelvis", "chest", "head"} <= joints.keys():
        faults += _trunk(joints, names, parents, rest_offset)
    missing = tuple(body for body in BODIES if body not in joints)
    return Roles(joints=joints, missing=missing, faults=tuple(faults))


def _limbs(names: Sequence[str], parents: Sequence[int]) -> dict[str, int]:
    """Joints of the limbs by name; of several with one name the nearest to the root."""
    found: dict[tuple[str, str], int] = {}
    for index in sorted(range(len(names)), key=lambda index: (len(_ancestors(parents, index)), index)):
        side, part = side_and_part(names[index])
        if side:
            found.setdefault((side, part), index)
    joints = {}
    for side in FEET:
        here = {part for each, part in found if each == side}
        for role, aliases in LIMBS.items():
            usable = [alias for alias in aliases if alias in here and _means(alias, role, here)]
            if usable:
                joints[f"{side}_{role}"] = found[side, usable[0]]
        _upper_end(joints, found, side, parents)
    return joints


def _upper_end(joints: dict[str, int], found: Mapping[tuple[str, str], int], side: str, parents: Sequence[int]) -> None:
    """A foot below an ankle is the toe, and a hand below a wrist is neither: SMPL's names (`L_Ankle`, `L_Foot`)."""
    for role in ("ankle", "wrist"):
        own, taken = found.get((side, role)), joints.get(f"{side}_{role}")
        if own is None or taken is None or own not in _ancestors(parents, taken):
            continue
        joints[f"{side}_{role}"] = own
        if role == "ankle":
            joints.setdefault(f"{side}_toe", taken)


def _means(alias: str, role: str, here: set[str]) -> bool:
    """Whether an alias has this role: `leg` is the thigh if another joint is the shank, and vice versa."""
    if alias != "leg":
        return True
    others = KNEE if role == "hip" else HIP
    return bool(here & {other for other in others if other != "leg"})


def _head(names: Sequence[str], parents: Sequence[int]) -> int | None:
    heads = [index for index, name in enumerate(names) if side_and_part(name) in {("", head) for head in HEADS}]
    return min(heads, key=lambda index: len(_ancestors(parents, index))) if heads else None


def _trunk(
    joints: dict[str, int], names: Sequence[str], parents: Sequence[int], rest_offset: Float[np.ndarray, "j 3"]
) -> list[str]:
    """Add spine and neck from the path between pelvis and head; return contradictions."""
    pelvis, chest, head = (joints[body] for body in ("pelvis", "chest", "head"))
    if pelvis == chest:
        return [f"legs and arms hang on the same joint '{names[pelvis]}'"]
    base = _common(parents, [pelvis, chest])
    if base is None:
        return [f"'{names[chest]}' does not descend from '{names[pelvis]}' or from what carries it"]
    least = NO_BONE * float(np.abs(rest_offset).max(initial=0.0))
    lower = _between(parents, base, chest, pelvis)
    joints["spine"] = lower[0] if lower else chest
    upper = [joint for joint in _between(parents, chest, head, chest) if np.abs(rest_offset[joint]).max() > least]
    joints["neck"] = upper[0] if upper else head
    return []


def _between(parents: Sequence[int], top: int, joint: int, without: int) -> list[int]:
    """Joints strictly between `top` and `joint`, from the top down."""
    return [
        each for each in reversed(_ancestors(parents, joint)) if top in _ancestors(parents, each) and each != without
    ]


def _ancestors(parents: Sequence[int], joint: int) -> list[int]:
    """Ancestors of a joint, its parent first."""
    above = []
    while (joint := parents[joint]) >= 0:
        above.append(joint)
    return above


def _common(parents: Sequence[int], joints: Sequence[int]) -> int | None:
    """Lowest common ancestor of `joints`, which may be one of them."""
    lines = [[joint, *_ancestors(parents, joint)] for joint in joints]
    return next((joint for joint in lines[0] if all(joint in line for line in lines)), None)


NAME = "by_structure"
"""Name of a measured map."""

UPRIGHT = 0.8
"""Least cosine of both legs to the vertical in a standing rest pose."""
SNAP = np.cos(np.deg2rad(15.0))
"""Cosine from which an axis of the rest pose is snapped to an axis of the file."""
ALONG = np.cos(np.deg2rad(30.0))
"""Cosine to the forward axis from which an arm is raised forward."""
TOE_FROM_ANKLE = (0.13, 0.0, -0.045)
"""Offset of the ball of the foot from the ankle in the foot's frame [m], for skeletons without toes."""


def standing_axes(motion: RawMotion, roles: Roles) -> Float[np.ndarray, "3 3"] | None:
    """Forward, left and up axes (columns) of a person in the rest pose; None if the pose is not standing."""
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
    """Position of every joint in the rest pose, in the file's unit."""
    place = np.zeros((len(motion.parents), 3))
    for joint, parent in enumerate(motion.parents):
        place[joint] = motion.rest_offset[joint] + (place[parent] if parent >= 0 else 0.0)
    return place


def measured_map(motion: RawMotion, roles: Roles) -> tuple[SkeletonMap, RawMotion] | None:
    """A map measured from the rest pose, and the motion with the bone ends that it needs as joints.

    None if the rest pose is not standing, or a hand is missing.
    """
    axes = standing_axes(motion, roles)
    if axes is None:
        return None
    names = {body: motion.joint_names[joint] for body, joint in roles.joints.items()}
    ends = []
    for side, (end, joint) in itertools.product(FEET, (("toe", "ankle"), ("wrist", "elbow"))):
        body, carrier = f"{side}_{end}", f"{side}_{joint}"
        if body not in roles.missing:
            continue
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
    """Direction of a foot at rest: forward, or to its toe if that is turned out by more than 15 degrees."""
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
    """A direction in the notation of a map."""
    for axis, sign in itertools.product(range(3), (1.0, -1.0)):
        if np.array_equal(direction, sign * np.eye(3)[axis]):
            return f"{'-' if sign < 0 else ''}{'xyz'[axis]}"
    return " ".join(repr(float(value)) for value in direction)
