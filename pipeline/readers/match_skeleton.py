"""Find a motion's skeleton map: stated, shipped, or measured from the names, tree and bones.

names without a shared prefix -> roles of the joints -> axes measured from the rest pose
shipped maps whose joints are all present and whose axes agree with the measured ones; several: the poses decide
none of them: the measured map; no pose to measure: a shipped map whose bones are along the same axes

Several maps: two maps that fit the same names and bones differ in the rotation of thigh, shank and foot about their own
axes. With the right one the knees bend about the thighs' left axes, and in the middle of the frames thighs are not
twisted against the pelvis and feet do not roll against the shanks. The measured angles are 4 to
6 degrees with the right map and 24 to 29 with the wrong one (CMU recordings and PFNN, which share names and bones).

Axes: a program that exports z up instead of y up rotates the frames of all joints by the same multiples of 90 degrees,
so the axes in a map (`up: y`) do not hold. The rest pose shows this by the directions of hips and head in the pelvis'
frame.
"""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, FEET
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.bvh import read_bvh
from pipeline.readers.gltf import read_gltf
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.roles import Roles, find_roles, measured_map, without_prefix
from pipeline.readers.skeleton_map import CANONICAL, BodyMap, SkeletonMap, shipped_maps, stated_map

MIN_COSINE = np.cos(np.deg2rad(35.0))
"""Least cosine for the agreement of the rest pose with a rotation by multiples of 90 degrees."""


def with_axes_of_map(motion: RawMotion, skeleton: SkeletonMap) -> RawMotion:
    """Rotate the joints' frames to the axes of the map; unchanged if they already agree."""
    turn = _quarter_turns(motion, skeleton)
    if np.array_equal(turn, np.eye(3)):
        return motion
    tips = {joint: tuple(float(value) for value in np.array(place) @ turn) for joint, place in motion.tips.items()}
    return dataclasses.replace(
        motion, rest_offset=motion.rest_offset @ turn, frame_turn=rotation.from_matrix(turn), tips=tips
    )


def _quarter_turns(motion: RawMotion, skeleton: SkeletonMap) -> Float[np.ndarray, "3 3"]:
    """Rotation from the map's joint axes to the file's; identity if the rest pose does not show it."""
    bodies = skeleton.bodies
    pelvis = bodies["pelvis"].joint
    try:
        left, right, head = (
            motion.offset_between(pelvis, bodies[name].joint) for name in ("left_hip", "right_hip", "head")
        )
    except KeyError:
        return np.eye(3)
    (pelvis_rest,) = skeleton.rest_frames(motion, ("pelvis",))
    expected = rotation.to_matrix(pelvis_rest) @ np.column_stack([CANONICAL["left"], CANONICAL["up"]])
    found = np.column_stack([rotation.normalize(left - right), rotation.normalize(head - 0.5 * (left + right))])
    fits = [turn for turn in _ALL_TURNS if np.sum((turn @ expected) * found, axis=0).min() > MIN_COSINE]
    return fits[0] if len(fits) == 1 else np.eye(3)


def _turns() -> list[np.ndarray]:
    """The 24 rotations that permute the coordinate axes."""
    signed = [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]
    return [matrix for matrix in signed if np.linalg.det(matrix) > 0.0]


_ALL_TURNS = _turns()


SAMPLES = 5_000
"""Most frames that are checked, from the middle of the motion."""
BENT = np.deg2rad(25.0)
"""Least knee bend at which the knee's axis is measured [rad]."""
FEWEST = 5
"""Least number of frames with a bent knee."""
BEST = np.deg2rad(20.0)
"""Largest misfit of the selected map [rad]."""
MARGIN = np.deg2rad(8.0)
"""Least difference to the misfit of all other maps [rad]."""


def distinguished(motion: RawMotion, maps: Sequence[SkeletonMap]) -> list[SkeletonMap]:
    """The single map that fits the legs' poses, or all of `maps` if several fit."""
    misfits = np.array([leg_misfit(with_axes_of_map(motion, one), one) for one in maps])
    if not np.isfinite(misfits).all():
        return list(maps)
    first, second = np.argsort(misfits, kind="stable")[:2]
    clear = misfits[first] <= BEST and misfits[second] - misfits[first] >= MARGIN
    return [maps[first]] if clear else list(maps)


def leg_misfit(motion: RawMotion, skeleton: SkeletonMap) -> float:
    """Mean deviation of the axes of knees, thighs and feet from a person's [rad]; NaN if no knee bends enough."""
    angles, first = [], max(0, (motion.frame_count - SAMPLES) // 2)
    for side in FEET:
        bodies = ("pelvis", *(f"{side}_{part}" for part in ("hip", "knee", "ankle")))
        joints = [skeleton.bodies[body].joint for body in bodies]
        quat = motion.world(joints, first, min(first + SAMPLES, motion.frame_count))[1]
        quat = rotation.multiply(quat, skeleton.rest_frames(motion, bodies))
        turns = rotation.to_rotvec(rotation.multiply(rotation.conjugate(quat[:, :-1]), quat[:, 1:]))
        turns = turns[np.isfinite(turns).all(axis=(1, 2))]
        bent = turns[rotation.length(turns[:, 1]) > BENT, 1]
        if len(bent) < FEWEST:
            return float("nan")
        axis = rotation.normalize(rotation.normalize(bent).mean(axis=0))
        angles += [float(np.arccos(np.clip(axis[1], -1.0, 1.0)))]
        angles += [abs(float(np.median(turns[:, 0, 2]))), abs(float(np.median(turns[:, 2, 0])))]
    return float(np.mean(angles))


COMPARED = (
    *("pelvis", "chest", "left_hip", "right_hip", "left_knee", "right_knee"),
    *("left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
)
"""Bodies whose axes are compared to detect a map with another rest pose or other bone axes."""

SAME_AXES = np.deg2rad(50.0)
"""Largest angle between the axes of a shipped map and those measured from the rest pose [rad]: thighs and arms are
rotated by up to 30 degrees in the rest poses of real recordings, and other conventions differ by 90 degrees."""

BONE_COSINE = 0.8
"""Least cosine between the bones of trunk and feet and the axes of a map."""


def match_skeleton(motion: RawMotion, stated: str | None = None) -> tuple[SkeletonMap, RawMotion]:
    """The map of a motion, or the stated one (a name or a `.yaml` file), and the motion with the map's joint names.

    Raises FileError for an unknown skeleton, AmbiguousFileError if several maps fit names, bones and poses.
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
        return measured
    if not best and roles.complete:
        best = _along_bones(bare, roles)
    if not best:
        raise FileError(path, *unknown_skeleton(bare.joint_names, roles))
    if len(best) > 1:
        best = distinguished(bare, best)
    if len(best) > 1:
        found = ", ".join(skeleton.name for skeleton in best)
        raise AmbiguousFileError(path, f"several skeletons fit: {found}.", "State `skeleton:` in data/sources.yaml.")
    return best[0], with_axes_of_map(bare, best[0])


def _stated(motion: RawMotion, bare: RawMotion, stated: str) -> tuple[SkeletonMap, RawMotion]:
    """The stated map, which may name the joints with or without their shared prefix."""
    skeleton = stated_map(motion.files[0], stated)
    for each in (motion, bare):
        if skeleton.joints <= set(each.joint_names):
            return skeleton, with_axes_of_map(each, skeleton)
    missing = ", ".join(sorted(skeleton.joints - set(bare.joint_names)))
    raise FileError(motion.files[0], f"the stated skeleton '{stated}' needs joints that the file lacks: {missing}.")


def _axes_agree(motion: RawMotion, one: SkeletonMap, measured: SkeletonMap, with_ends: RawMotion) -> bool:
    """Whether a map's axes of the bodies agree with those measured from the rest pose."""
    try:
        turned = with_axes_of_map(motion, one)
        frames = one.rest_frames(turned, COMPARED)
    except FileError:
        return False
    if turned.frame_turn is not None:
        frames = rotation.multiply(turned.frame_turn, frames)
    return bool(rotation.angle_between(frames, measured.rest_frames(with_ends, COMPARED)).max() < SAME_AXES)


def _along_bones(motion: RawMotion, roles: Roles) -> list[SkeletonMap]:
    """Shipped maps, with this file's joint names, whose bones have the same axes and whose legs fit the poses."""
    if roles.missing:
        return []
    renamed = [_renamed(motion, roles, one) for one in shipped_maps().values()]
    fitting = [one for one in renamed if one.fits(motion) and _bones_agree(motion, one, roles)]
    return [one for one in fitting if leg_misfit(motion, one) <= BEST]


def _renamed(motion: RawMotion, roles: Roles, one: SkeletonMap) -> SkeletonMap:
    """A map with this file's joint names, without its further requirements."""
    names = {body: motion.joint_names[joint] for body, joint in roles.joints.items()}
    name_of = {each.joint: names[body] for body, each in one.bodies.items()}
    bodies = {}
    for body, each in one.bodies.items():
        directions = {way: name_of.get(value, value) for way, value in each.directions().items()}
        bodies[body] = dataclasses.replace(each, joint=names[body], **directions)
    return dataclasses.replace(one, bodies=bodies, also=(), rest={})


def _bones_agree(motion: RawMotion, one: SkeletonMap, roles: Roles) -> bool:
    """Whether, with the map's axes, pelvis to chest, neck and head is up, and right to left hip is left."""
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


LISTED = 12
"""Most names listed in a message."""

OPEN = "FILL_IN"
"""Placeholder in a template map for a joint that the user has to name."""

MAP_AXES: dict[str, dict[str, str]] = {
    "hip": {"down": "knee", "left": "x"},
    "knee": {"down": "ankle", "left": "x"},
    "ankle": {"ahead": "z", "left": "x"},
    "toe": {"ahead": "z", "left": "x"},
    "shoulder": {"down": "elbow", "ahead": "z"},
    "elbow": {"down": "wrist", "ahead": "z"},
    "wrist": {"down": "x", "ahead": "z"},
}
"""Directions of the limbs' bodies in a y-up file with stretched arms; names of parts refer to their joints."""


def unknown_skeleton(names: Sequence[str], roles: Roles) -> tuple[str, str]:
    """Problem and remedy for an unknown skeleton: the closest map, differing joints, contradictions in the tree."""
    have = set(names)
    closest = max(shipped_maps().values(), key=lambda one: (len(one.joints & have) / len(one.joints), one.name))
    missing = ", ".join(sorted(closest.joints - have)) or "none"
    extra = [name[:40] for name in names if name not in closest.joints]
    more = f" and {len(extra) - LISTED} more" if len(extra) > LISTED else ""
    needed = [body for body in roles.missing if not body.endswith(("toe", "wrist"))]
    unfound = [body for body in needed if "_" in body or body == "head"] or needed
    parts = [f"no joint is known as {', '.join(unfound)}"] if unfound else list(roles.faults[:3])
    if not parts:
        parts = ["its rest pose is none that a person could stand in"]
    problem = (
        f"unknown skeleton of {len(names)} joints: {'; '.join(parts)}. Closest is '{closest.name}'; "
        f"missing: {missing}; not in it: {', '.join(extra[:LISTED]) or 'none'}{more}."
    )
    do = (
        "Print a map to start from with `booster-lab inspect FILE --write-map`, complete it (docs/sources.md) and "
        "state it as `skeleton:` in data/sources.yaml."
    )
    return problem, do


def map_text(title: str, bodies: Mapping[str, BodyMap]) -> str:
    """A skeleton map as YAML."""
    listed: dict[str, dict[str, Any]] = {}
    for body in BODIES:
        each = bodies[body]
        listed[body] = {"joint": each.joint, **each.directions()}
        if each.pitch_deg:
            listed[body]["pitch_deg"] = each.pitch_deg
        if any(each.offset):
            listed[body]["offset"] = list(each.offset)
    value = {"title": title, "bodies": listed}
    text = yaml.safe_dump(value, default_flow_style=None, sort_keys=False, width=1_000, allow_unicode=True)
    return f'# Axes and pitch_deg: see docs/sources.md, "Skeleton maps".\n{text}'


def map_to_start_from(names: Sequence[str], roles: Roles) -> str:
    """A template map with the known joints and `FILL_IN` for the others."""
    joint = {body: names[index] for body, index in roles.joints.items()}
    bodies = {}
    for body in BODIES:
        side, _, part = body.partition("_")
        directions = MAP_AXES.get(part, {"up": "y", "left": "x"})
        known: dict[str, Any] = {
            way: joint.get(f"{side}_{value}", OPEN) if value in MAP_AXES else value for way, value in directions.items()
        }
        if (side, part) == ("right", "wrist"):
            known["down"] = "-x"
        bodies[body] = BodyMap(joint=joint.get(body, OPEN), **known)
    listed = "".join(f"#   {name}\n" for name in names)
    return f"# Joints of the file:\n{listed}{map_text('What this skeleton is', bodies)}"


READERS = {".bvh": read_bvh, ".glb": read_gltf, ".gltf": read_gltf}
"""Readers of formats whose skeletons may need a map of their own."""


def written_map(path: Path, stated: str | None = None) -> str:
    """The map that a file is read with, else a template with the known joints. Raises FileError."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(sorted(READERS))
        raise FileError(path, f"files of this format need no skeleton map; those that may are: {known}.")
    motion: RawMotion = reader(path)
    bare = motion.renamed(without_prefix(motion.joint_names))
    try:
        skeleton, _ = match_skeleton(motion, stated)
    except FileError:
        roles = find_roles(bare.joint_names, bare.parents, bare.rest_offset)
        return map_to_start_from(bare.joint_names, roles)
    return map_text(skeleton.title, skeleton.bodies)
