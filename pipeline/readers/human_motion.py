"""Convert a format's joints to the canonical human: skeleton map, unit (from the leg length), up axis, bodies."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, FEET, HumanClip, body
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.match_skeleton import match_skeleton
from pipeline.readers.raw_motion import RawMotion, refuse_pose
from pipeline.readers.skeleton_map import SkeletonMap
from pipeline.readers.source import Statement
from pipeline.readers.velocity_rate import frame_rate

METRES: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "cmu": 0.0254 / 0.45}
"""Metres per unit. `cmu` is the unit of the CMU recordings, 1/0.45 inch (their ASF files: `length 0.45`)."""

STATE_UNIT = f"State `unit:` for it in data/sources.yaml, one of {', '.join(METRES)} or metres per unit."

LEG_MIN, LEG_MAX = 0.60, 1.10
"""Plausible leg length, thigh plus shank [m]: 0.245 + 0.246 of the stature (Drillis and Contini 1966, in Winter 2009,
fig. 4.1) for 1.22 to 2.24 m. The limits are a factor of 1.83 apart, less than any two of the units, so at most one
unit fits."""

STATED_LEG_MIN, STATED_LEG_MAX = 0.4, 1.4
"""Leg lengths accepted for a stated unit [m]; otherwise the statement is wrong."""


def find_unit(path: Path, leg: float, stated: str | None) -> tuple[str, float]:
    """Name of the unit and metres per unit, of a skeleton whose leg is `leg` units long.

    `stated` is a unit's name or metres per unit. Raises AmbiguousFileError if no unit gives a human leg, FileError if
    the stated one does not.
    """
    if stated is not None:
        try:
            metres = METRES[stated] if stated in METRES else float(stated)
        except ValueError:
            metres = 0.0
        if not 1e-6 < metres < 1e3:
            raise FileError(path, f"'{stated}' is not a unit.", STATE_UNIT)
        if not STATED_LEG_MIN <= leg * metres <= STATED_LEG_MAX:
            problem = f"with the stated unit '{stated}' a leg is {leg * metres:.3g} m long, a human's is about 0.8 m."
            raise FileError(path, problem, "Correct `unit:` in data/sources.yaml.")
        return stated, metres
    fitting = [name for name, metres in METRES.items() if LEG_MIN <= leg * metres <= LEG_MAX]
    if len(fitting) != 1:
        tried = ", ".join(f"{leg * metres:.3g} m in {name}" for name, metres in METRES.items())
        problem = f"the unit of length can't be inferred: a leg (hip to ankle) is {leg:.4g} units, which is {tried}."
        raise AmbiguousFileError(path, problem, STATE_UNIT)
    return fitting[0], METRES[fitting[0]]


TO_Z_UP: dict[str, np.ndarray] = {
    "z": np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "y": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "x": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "-z": np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]),
    "-y": np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]),
    "-x": np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]]),
}
"""Rotation from a file's axes to the world's, by the file's up axis. A y-up file's z becomes x (forward)."""

MIN_COSINE = 0.8
"""Least cosine between the mean direction from feet to head and the up axis (37 degrees)."""

MIN_SHARE = 0.5
"""Least share of frames in which the head is above the feet along that axis."""


def find_up_axis(path: Path, feet_to_head: Float[np.ndarray, "t 3"], stated: str | None) -> str:
    """The file's up axis, from the vector of the feet's middle to the head in each frame (NaN where missing).

    Raises AmbiguousFileError when no axis fits, FileError for a stated axis that isn't one.
    """
    if stated is not None:
        if stated not in TO_Z_UP:
            raise FileError(path, f"the stated up axis is '{stated}', expected one of {', '.join(TO_Z_UP)}.")
        return stated
    valid = feet_to_head[np.isfinite(feet_to_head).all(axis=1)]
    direction = valid / np.maximum(np.linalg.norm(valid, axis=1, keepdims=True), 1e-12)
    mean = direction.mean(axis=0) if len(direction) else np.zeros(3)
    axis = int(np.argmax(mean))
    cosine = mean[axis] / max(float(np.linalg.norm(mean)), 1e-12)
    share = float(np.mean(direction[:, axis] > MIN_COSINE)) if len(direction) else 0.0
    if cosine < MIN_COSINE or share < MIN_SHARE:
        found = ", ".join(f"{value:.2f} along {name}" for name, value in zip("xyz", mean, strict=True))
        problem = (
            f"the up axis can't be inferred: from the feet to the head is on average {found}, and the head is above "
            f"the feet along one axis in {100 * share:.0f} % of the frames."
        )
        raise AmbiguousFileError(path, problem, "State `up:` for it in data/sources.yaml, such as `up: y`.")
    return "xyz"[axis]


FRAMES_AT_ONCE = 4096
"""Frames per batch, which limits the memory for intermediate results."""

MAX_BODY_TILT_DEG = 60.0
"""Largest mean angle of the left axes of pelvis and chest to the hip and the shoulder line."""


@dataclass(frozen=True, kw_only=True)
class Canonical:
    """A human clip and how its file was understood."""

    clip: HumanClip
    skeleton: str
    unit: str
    metres_per_unit: float
    up_axis: str


def to_human(motion: RawMotion, name: str, statement: Statement, *, consume: bool = False) -> Canonical:
    """Convert a motion to a canonical clip.

    Args:
        motion: motion from a reader
        name: name of the clip
        statement: stated facts about the file
        consume: free the memory of the motion's frames during the conversion; it can't be used again

    Raises FileError (unknown skeleton, mirrored, axes that differ from the map's) and AmbiguousFileError (skeleton,
    unit, up axis or rate neither in the file nor stated).
    """
    path = motion.files[0]
    refuse_pose(path, motion.frame_count)
    skeleton, motion = match_skeleton(motion, statement.skeleton)
    unit, metres = find_unit(path, _leg_length(motion, skeleton), statement.unit or motion.unit)
    pos, quat = _bodies_in_file(motion, skeleton, consume)
    ankles = 0.5 * (pos[:, body("left_ankle")] + pos[:, body("right_ankle")])
    up_axis = find_up_axis(path, pos[:, body("head")] - ankles, statement.up)
    _to_world(pos, quat, TO_Z_UP[up_axis], metres, skeleton)
    fps = frame_rate(path, motion.fps or motion.assumed_fps, statement, motion.rate_fault)
    _make_continuous(quat)
    clip = HumanClip(name=name, fps=fps, body_pos_w=pos, body_quat_w=quat)
    _check_sides(motion, clip, skeleton)
    return Canonical(clip=clip, skeleton=skeleton.name, unit=unit, metres_per_unit=metres, up_axis=up_axis)


def _bodies_in_file(
    motion: RawMotion, skeleton: SkeletonMap, consume: bool
) -> tuple[Float[np.ndarray, "t 19 3"], Float[np.ndarray, "t 19 4"]]:
    """Positions of the bodies' joints and orientations of the bodies, in the file's world and unit."""
    joints = [skeleton.bodies[name].joint for name in BODIES]
    rest = skeleton.rest_frames(motion)
    pos, quat = np.empty((motion.frame_count, len(BODIES), 3)), np.empty((motion.frame_count, len(BODIES), 4))
    for start, stop in _chunks(motion.frame_count):
        pos[start:stop], turned = motion.world(joints, start, stop)
        quat[start:stop] = rotation.multiply(turned, rest)
        if consume:
            motion.poses.forget(stop)
    return pos, quat


def _to_world(
    pos: Float[np.ndarray, "t 19 3"],
    quat: Float[np.ndarray, "t 19 4"],
    axes: Float[np.ndarray, "3 3"],
    metres: float,
    skeleton: SkeletonMap,
) -> None:
    """Convert bodies in place from the file's world and unit to ours; add bodies that the skeleton lacks."""
    axes_quat = rotation.from_matrix(axes)
    offset = np.array([skeleton.bodies[name].offset for name in BODIES])
    for start, stop in _chunks(len(pos)):
        turned = rotation.multiply(axes_quat, quat[start:stop])
        pos[start:stop] = pos[start:stop] @ axes.T * metres + rotation.rotate(turned, offset)
        quat[start:stop] = rotation.normalize(turned)


def _chunks(frames: int) -> list[tuple[int, int]]:
    """Batches [start, stop) of frames."""
    return [(start, min(start + FRAMES_AT_ONCE, frames)) for start in range(0, frames, FRAMES_AT_ONCE)]


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


def _make_continuous(quat: Float[np.ndarray, "t 19 4"]) -> None:
    """Make quaternions sign-continuous in place, the first with w >= 0; a missing frame does not spread."""
    valid = np.concatenate([np.isfinite(quat[start:stop]).all(axis=(1, 2)) for start, stop in _chunks(len(quat))])
    known = np.flatnonzero(valid)
    if not len(known):
        return
    before = quat[known[0]]
    sign = np.where(before[:, :1] < 0.0, -1.0, 1.0)
    before = before * sign
    quat[~valid] *= sign
    for first, last in _chunks(len(known)):
        frames = known[first:last]
        chunk = rotation.make_continuous(np.concatenate([before[None], quat[frames]]))
        quat[frames] = chunk[1:]
        before = chunk[-1]


def _check_sides(motion: RawMotion, clip: HumanClip, skeleton: SkeletonMap) -> None:
    """Check that sides are not swapped and that pelvis and chest have the map's orientation. Raises FileError."""
    known, swapped, off = 0, 0.0, {"pelvis": 0.0, "chest": 0.0}
    for start, stop in _chunks(clip.frame_count):
        part = clip.cut(start, stop, clip.name)
        valid = np.isfinite(part.body_pos_w).all(axis=(1, 2))
        known += int(valid.sum())
        hips = rotation.normalize(part.pos("left_hip") - part.pos("right_hip"))[valid]
        shoulders = rotation.normalize(part.pos("left_shoulder") - part.pos("right_shoulder"))[valid]
        ahead = sum(_ahead(part, side)[valid] for side in FEET)
        left = np.cross([0.0, 0.0, 1.0], rotation.normalize(ahead * np.array([1.0, 1.0, 0.0])))
        swapped += float(np.sum(left * hips))
        for name, line in (("pelvis", hips), ("chest", shoulders)):
            off[name] += float(np.sum(rotation.rotate(part.quat(name)[valid], np.array([0.0, 1.0, 0.0])) * line))
    if not known:
        raise FileError(motion.files[0], "no frame is complete: every row holds values that are not numbers.")
    if swapped < 0.0:
        problem = "left and right are swapped: seen along its toes and knees, the person's left hip is on the right."
        raise FileError(motion.files[0], problem, "The file is mirrored, or its up axis points down (state `up:`).")
    for name, total in off.items():
        tilt_deg = float(np.rad2deg(np.arccos(np.clip(total / known, -1.0, 1.0))))
        if tilt_deg > MAX_BODY_TILT_DEG:
            problem = (
                f"the joints are named as in the skeleton '{skeleton.name}', but their axes differ: the {name}'s left "
                f"axis is {tilt_deg:.0f} degrees off the line from right to left."
            )
            raise FileError(motion.files[0], problem, "Write a map of its own (docs/sources.md) and state it.")


def _ahead(clip: HumanClip, side: str) -> Float[np.ndarray, "t 3"]:
    """Forward vector of a leg [m]: ankle to toe, plus the offset of the knee from the line of hip and ankle."""
    hip, knee, ankle, toe = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle", "toe"))
    return (toe - ankle) + (knee - 0.5 * (hip + ankle))
