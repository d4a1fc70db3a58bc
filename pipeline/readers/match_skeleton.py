"""Which skeleton a motion is of: a map that is stated, one that ships, or one measured from its names, tree and bones.

names without a shared prefix -> roles of the joints -> axes measured from the rest pose
shipped maps whose joints are all there and whose axes agree with what was measured; several: the poses decide
none of them: the measured map; no pose to measure: a shipped map whose bones are along the same axes
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from pipeline import rotation
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.joint_names import without_prefix
from pipeline.readers.leg_misfit import BEST, distinguished, leg_misfit
from pipeline.readers.local_axes import with_axes_of_map
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.rest_pose import measured_map
from pipeline.readers.roles import Roles, find_roles
from pipeline.readers.skeleton_map import SkeletonMap, shipped_maps, stated_map
from pipeline.readers.unknown_skeleton import unknown_skeleton

COMPARED = (
    "pelvis",
    "chest",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
)
"""Bodies whose axes are compared: they show a map of another rest pose or of other bone axes."""

SAME_AXES = np.deg2rad(50.0)
"""Axes of a shipped map may differ by this from those measured from the rest pose [rad]: people's thighs and arms are
turned by up to 30 degrees in the rest poses of real recordings, and other conventions differ by quarter turns."""

BONE_COSINE = 0.8
"""How well the bones of trunk and feet have to lie along the axes that a map gives them."""


@dataclass(frozen=True, kw_only=True)
class Matched:
    """A motion whose joints have the names and axes that the map uses."""

    skeleton: SkeletonMap
    motion: RawMotion


def match_skeleton(motion: RawMotion, stated: str | None = None) -> Matched:
    """The map of a motion, or the one that is stated (a name or a `.yaml` file).

    Raises FileError for an unknown skeleton, AmbiguousFileError where several maps fit and the poses fit each of them.
    """
    bare = motion.renamed(without_prefix(motion.joint_names))
    if stated is not None:
        return _stated(motion, bare, stated)
    path, roles = motion.files[0], find_roles(bare.joint_names, bare.parents, bare.rest_offset)
    measured = measured_map(bare, roles) if roles.complete else None
    fitting = [one for one in shipped_maps().values() if one.fits(bare)]
    if measured is not None:
        fitting = [one for one in fitting if _axes_agree(bare, one, *measured)]
    best = [one for one in fitting if not any(one.joints < other.joints for other in fitting)]
    if not best and measured is not None:
        return Matched(skeleton=measured[0], motion=measured[1])
    if not best and roles.complete:
        best = _along_bones(bare, roles)
    if not best:
        raise FileError(path, *unknown_skeleton(bare.joint_names, roles))
    if len(best) > 1:
        best = distinguished(bare, best)
    if len(best) > 1:
        found = ", ".join(skeleton.name for skeleton in best)
        raise AmbiguousFileError(path, f"several skeletons fit: {found}.", "State `skeleton:` in data/sources.yaml.")
    return Matched(skeleton=best[0], motion=with_axes_of_map(bare, best[0]))


def _stated(motion: RawMotion, bare: RawMotion, stated: str) -> Matched:
    """The stated map, which may name the joints with or without what they all begin with."""
    skeleton = stated_map(motion.files[0], stated)
    for each in (motion, bare):
        if skeleton.joints <= set(each.joint_names):
            return Matched(skeleton=skeleton, motion=with_axes_of_map(each, skeleton))
    missing = ", ".join(sorted(skeleton.joints - set(bare.joint_names)))
    raise FileError(motion.files[0], f"the stated skeleton '{stated}' needs joints that the file lacks: {missing}.")


def _axes_agree(motion: RawMotion, one: SkeletonMap, measured: SkeletonMap, with_ends: RawMotion) -> bool:
    """A map gives the bodies about the axes that the rest pose shows."""
    try:
        turned = with_axes_of_map(motion, one)
        frames = one.rest_frames(turned, COMPARED)
    except FileError:
        return False
    if turned.frame_turn is not None:
        frames = rotation.multiply(turned.frame_turn, frames)
    return bool(rotation.angle_between(frames, measured.rest_frames(with_ends, COMPARED)).max() < SAME_AXES)


def _along_bones(motion: RawMotion, roles: Roles) -> list[SkeletonMap]:
    """Shipped maps, under the names of this file, whose bones are along the same axes and whose legs fit the poses."""
    if roles.missing:
        return []
    renamed = [_renamed(motion, roles, one) for one in shipped_maps().values()]
    fitting = [one for one in renamed if one.fits(motion) and _bones_agree(motion, one, roles)]
    return [one for one in fitting if leg_misfit(motion, one) <= BEST]


def _renamed(motion: RawMotion, roles: Roles, one: SkeletonMap) -> SkeletonMap:
    """A map under the names of this file, without what it asks for beside its bodies."""
    names = {body: motion.joint_names[joint] for body, joint in roles.joints.items()}
    name_of = {each.joint: names[body] for body, each in one.bodies.items()}
    bodies = {}
    for body, each in one.bodies.items():
        directions = {way: name_of.get(value, value) for way, value in each.directions().items()}
        bodies[body] = dataclasses.replace(each, joint=names[body], **directions)
    return dataclasses.replace(one, bodies=bodies, also=(), rest={})


def _bones_agree(motion: RawMotion, one: SkeletonMap, roles: Roles) -> bool:
    """From pelvis to chest, neck and head is up, from right to left hip is left, with the map's axes."""
    names = {body: motion.joint_names[joint] for body, joint in roles.joints.items()}
    try:
        pairs = [("pelvis", "chest"), ("chest", "neck"), ("neck", "head")]
        bones = [motion.offset_between(names[lower], names[upper]) for lower, upper in pairs]
        sides = [motion.offset_between(names["pelvis"], names[f"{side}_hip"]) for side in ("left", "right")]
        frames = one.rest_frames(motion, ("pelvis", "chest", "neck"))
    except (KeyError, FileError):
        return False
    up = rotation.rotate(frames, np.array([0.0, 0.0, 1.0]))
    left = rotation.rotate(frames[:1], np.array([0.0, 1.0, 0.0]))[0]
    upright = np.sum(up * rotation.normalize(np.array(bones)), axis=1).min()
    return bool(min(upright, left @ rotation.normalize(sides[0] - sides[1])) > BONE_COSINE)
