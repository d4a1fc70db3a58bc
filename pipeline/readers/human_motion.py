"""From a format's joints to the canonical human: skeleton map, unit, up axis, then body by body."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, HumanClip
from pipeline.errors import FileError
from pipeline.readers.frame_rate import frame_rate
from pipeline.readers.local_axes import with_axes_of_map
from pipeline.readers.raw_motion import MIN_FRAMES, RawMotion, counted
from pipeline.readers.skeleton_map import SkeletonMap, find_map
from pipeline.readers.statement import Statement
from pipeline.readers.unit import find_unit
from pipeline.readers.up_axis import TO_Z_UP, find_up_axis

MAX_BODY_TILT_DEG = 60.0
"""How far the left axes of pelvis and chest may lie, on average, from the hip and the shoulder line."""


@dataclass(frozen=True, kw_only=True)
class Canonical:
    """A human clip and how its file was understood."""

    clip: HumanClip
    skeleton: str
    unit: str
    metres_per_unit: float
    up_axis: str


def to_human(motion: RawMotion, name: str, statement: Statement) -> Canonical:
    """The canonical clip of a motion.

    Raises FileError (unknown skeleton, mirrored, axes that are not the map's) and AmbiguousFileError (unit, up axis
    or rate that the file does not tell).
    """
    path = motion.files[0]
    if len(motion.joint_pos_w) < MIN_FRAMES:
        raise FileError(path, f"the file has {counted(len(motion.joint_pos_w))}, which is no motion.")
    skeleton = find_map(motion, statement.skeleton)
    motion = with_axes_of_map(motion, skeleton)
    unit, metres = find_unit(path, _leg_length(motion, skeleton), statement.unit or motion.unit)
    joint = {body: motion.joint_names.index(skeleton.bodies[body].joint) for body in BODIES}
    ankles = 0.5 * (motion.joint_pos_w[:, joint["left_ankle"]] + motion.joint_pos_w[:, joint["right_ankle"]])
    up_axis = find_up_axis(path, motion.joint_pos_w[:, joint["head"]] - ankles, statement.up)
    axes = TO_Z_UP[up_axis]
    axes_quat = rotation.from_matrix(axes)
    order = [joint[body] for body in BODIES]
    rest = skeleton.rest_frames(motion)
    quat = rotation.multiply(axes_quat, rotation.multiply(motion.joint_quat_w[:, order], rest))
    offset = np.array([skeleton.bodies[body].offset for body in BODIES])
    pos = motion.joint_pos_w[:, order] @ axes.T * metres + rotation.rotate(quat, offset)
    clip = HumanClip(
        name=name,
        fps=frame_rate(path, motion.fps or motion.assumed_fps, statement),
        body_pos_w=pos,
        body_quat_w=_continuous(rotation.normalize(quat)),
    )
    _check_sides(motion, clip, skeleton)
    return Canonical(clip=clip, skeleton=skeleton.name, unit=unit, metres_per_unit=metres, up_axis=up_axis)


def _leg_length(motion: RawMotion, skeleton: SkeletonMap) -> float:
    """Thigh plus shank in the file's unit, mean of both sides, at rest."""
    lengths = []
    for side in ("left", "right"):
        chain = [skeleton.bodies[f"{side}_{part}"].joint for part in ("hip", "knee", "ankle")]
        for upper, lower in itertools.pairwise(chain):
            try:
                lengths.append(float(np.linalg.norm(motion.offset_between(upper, lower))))
            except KeyError as error:
                problem = f"joint '{lower}' does not descend from '{upper}', which '{skeleton.name}' expects."
                raise FileError(motion.files[0], problem) from error
    return sum(lengths) / 2.0


def _continuous(quat: np.ndarray) -> np.ndarray:
    """Sign-continuous quaternions (t, n, 4), the first with w >= 0; a missing frame does not spread."""
    valid = np.isfinite(quat).all(axis=(1, 2))
    if valid.all():
        result = rotation.make_continuous(quat)
    else:
        result = quat.copy()
        result[valid] = rotation.make_continuous(quat[valid])
    first = result[np.argmax(valid)][None, :, :1] if valid.any() else result[:0]
    return np.where(first < 0.0, -result, result) if len(first) else result


def _check_sides(motion: RawMotion, clip: HumanClip, skeleton: SkeletonMap) -> None:
    """Left is left, and pelvis and chest are turned the way the map expects. Raises FileError."""
    valid = np.isfinite(clip.body_pos_w).all(axis=(1, 2))
    if not valid.any():
        raise FileError(motion.files[0], "no frame is complete: every row holds values that are not numbers.")
    hips = rotation.normalize(clip.pos("left_hip") - clip.pos("right_hip"))[valid]
    shoulders = rotation.normalize(clip.pos("left_shoulder") - clip.pos("right_shoulder"))[valid]
    ahead = sum(_ahead(clip, side)[valid] for side in ("left", "right"))
    ahead = rotation.normalize(ahead * np.array([1.0, 1.0, 0.0]))
    left = np.cross([0.0, 0.0, 1.0], ahead)
    if float(np.mean(np.sum(left * hips, axis=1))) < 0.0:
        problem = "left and right are swapped: seen along its toes and knees, the person's left hip is on the right."
        raise FileError(motion.files[0], problem, "The file is mirrored, or its up axis points down (state `up:`).")
    for body, line in (("pelvis", hips), ("chest", shoulders)):
        axis = rotation.rotate(clip.quat(body), np.array([0.0, 1.0, 0.0]))[valid]
        tilt_deg = float(np.rad2deg(np.arccos(np.clip(np.mean(np.sum(axis * line, axis=1)), -1.0, 1.0))))
        if tilt_deg > MAX_BODY_TILT_DEG:
            problem = (
                f"the joints are named as in the skeleton '{skeleton.name}', but their axes differ: the {body}'s left "
                f"axis is {tilt_deg:.0f} degrees off the line from right to left."
            )
            raise FileError(motion.files[0], problem, "Write a map of its own (docs/sources.md) and state it.")


def _ahead(clip: HumanClip, side: str) -> np.ndarray:
    """Where a leg points (t, 3) [m]: ankle to toe, plus how far the knee lies before the line of hip and ankle."""
    hip, knee, ankle, toe = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle", "toe"))
    return (toe - ankle) + (knee - 0.5 * (hip + ankle))
