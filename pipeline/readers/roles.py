"""Which joint of a skeleton is which canonical body, found from its names and its tree together.

The alias lists cover the names that Mixamo, Rokoko, Xsens and MotionBuilder, Nokov, OptiTrack Motive, Perception
Neuron, SOMA and Kimodo, 100STYLE, CMU, LAFAN1, Unreal, 3ds Max's Biped, VRM and Rigify give to joints.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.clips.human_clip import BODIES, FEET

SEPARATORS = ":|_-. "

HIP = ("upleg", "upperleg", "thigh", "femur", "hip", "leg")
KNEE = ("lowerleg", "lowleg", "shin", "calf", "tibia", "shank", "knee", "leg")
ANKLE = ("foot", "ankle")
TOE = ("toebase", "toe", "toes", "toe0", "ball", "forefoot")
SHOULDER = ("upperarm", "uparm", "uarm", "humerus", "arm", "shoulder")
ELBOW = ("forearm", "lowerarm", "lowarm", "farm", "radius", "elbow")
WRIST = ("hand", "wrist", "palm")
"""Names of the joint at the upper end of each part of a limb, the surest first. `leg` is the thigh of skeletons that
call the shank otherwise, `shoulder` the upper arm of skeletons without an arm."""

LIMBS = {"hip": HIP, "knee": KNEE, "ankle": ANKLE, "toe": TOE, "shoulder": SHOULDER, "elbow": ELBOW, "wrist": WRIST}
HEADS = ("head", "chead", "spine006")
"""Of VRM (`C_Head`) and Rigify (`spine.006`) the last two."""

_PARTS = frozenset(alias for aliases in LIMBS.values() for alias in aliases)


def shared_prefix(names: Sequence[str]) -> str:
    """What all joints but a root or two begin with, up to a separator: `mixamorig7:`, `Take_01:`, `Character1_`."""
    for skipped in range(min(3, len(names))):
        kept = names[skipped:]
        common = os.path.commonprefix(kept) if len(kept) > 2 else ""  # noqa: RUF071, by characters
        last = max(common.rfind(separator) for separator in SEPARATORS)
        prefix = common[: last + 1]
        if prefix and all(len(name) > len(prefix) for name in kept):
            return prefix
    return ""


def without_prefix(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names without their shared prefix; unchanged where that would make two of them equal."""
    prefix = shared_prefix(names)
    bare = tuple(name.removeprefix(prefix) for name in names)
    return bare if len(set(bare)) == len(names) else names


def side_and_part(name: str) -> tuple[str, str]:
    """`left`, `right` or nothing, and the rest of a name in small letters without separators."""
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
"""Joints closer to their parent than this share of the leg are at the same place."""


@dataclass(frozen=True, kw_only=True)
class Roles:
    """Joints of canonical bodies by index."""

    joints: Mapping[str, int]
    """Canonical body -> joint. A toe or a wrist may be missing; `spine` and `neck` may share a joint with another."""
    missing: tuple[str, ...]
    """Bodies for which no joint was found."""
    faults: tuple[str, ...]
    """Where the tree contradicts the names, as phrases."""

    @property
    def complete(self) -> bool:
        """Every body but toes and wrists has its joint, and the tree agrees."""
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
    if head is not None:
        joints["head"] = head
    hips = [limbs[f"{side}_hip"] for side in FEET if f"{side}_hip" in limbs]
    shoulders = [limbs[f"{side}_shoulder"] for side in FEET if f"{side}_shoulder" in limbs]
    if len(hips) == 2:
        pelvis = _common(parents, hips)
        if pelvis is not None:
            joints["pelvis"] = pelvis
    if len(shoulders) == 2 and head is not None:
        chest = _common(parents, [*shoulders, head])
        if chest is not None:
            joints["chest"] = chest
    if {"pelvis", "chest", "head"} <= joints.keys():
        faults += _trunk(joints, names, parents, rest_offset)
    missing = tuple(body for body in BODIES if body not in joints)
    return Roles(joints=joints, missing=missing, faults=tuple(faults))


def _limbs(names: Sequence[str], parents: Sequence[int]) -> dict[str, int]:
    """Joints of the limbs by name; of several that are named alike the one nearest to the root."""
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
    """`leg` is the thigh where another joint is the shank, and the shank where another is the thigh."""
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
    """Add spine and neck from the way from pelvis to head; what contradicts them."""
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
    """Joints above one, its parent first."""
    above = []
    while (joint := parents[joint]) >= 0:
        above.append(joint)
    return above


def _common(parents: Sequence[int], joints: Sequence[int]) -> int | None:
    """The lowest joint that all of `joints` descend from, or are."""
    lines = [[joint, *_ancestors(parents, joint)] for joint in joints]
    return next((joint for joint in lines[0] if all(joint in line for line in lines)), None)
