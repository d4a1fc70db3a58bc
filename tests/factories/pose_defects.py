"""Defects of some frames: joints that are missing, elsewhere, on the wrong side, or stand still."""

from __future__ import annotations

import numpy as np

from pipeline import rotation
from pipeline.clips.human_clip import BODIES, body
from pipeline.repair.tree import to_local
from tests.factories.defect_draft import LIMBS, Draft

EVERY = tuple(range(len(BODIES)))
SPIKE_M, SPIKE_RAD = 0.03, np.deg2rad(10.0)


def missing_frames(draft: Draft) -> None:
    """Every joint is NaN, or positions or orientations alone."""
    which = draft.rng.integers(3)
    if which != 1:
        draft.pos[draft.span] = np.nan
    if which != 2:
        draft.quat[draft.span] = np.nan


def zeroed_frames(draft: Draft) -> None:
    """Every number is 0, or positions are 0 and orientations the identity."""
    draft.pos[draft.span] = 0.0
    draft.quat[draft.span] = 0.0 if draft.rng.integers(2) else rotation.IDENTITY


def joint_dropout(draft: Draft) -> None:
    """One joint is missing, zero, held in the world or in its parent's frame, or in the pose of rest."""
    _dropout(draft, (int(draft.rng.integers(1, len(BODIES))),))


def limb_dropout(draft: Draft) -> None:
    """The same of the joints of a limb."""
    _dropout(draft, LIMBS[int(draft.rng.integers(len(LIMBS)))])


def body_dropout(draft: Draft) -> None:
    """All joints but the pelvis are missing or in the pose of rest; or all are missing or held."""
    _dropout(draft, EVERY if draft.rng.integers(2) else EVERY[1:])


def _dropout(draft: Draft, joints: tuple[int, ...]) -> None:
    there = (draft.span, list(joints))
    way = draft.rng.choice(["missing", "zero", "held", "held_angles", "rest"])
    if joints == EVERY and way in ("held_angles", "rest"):
        way = "held"
    if way == "missing":
        draft.pos[there], draft.quat[there] = np.nan, np.nan
    elif way == "zero":
        draft.pos[there], draft.quat[there] = 0.0, rotation.IDENTITY
    elif way == "held":
        draft.holds, draft.still, draft.still_in_world = True, joints, True
        draft.pos[there] = draft.pos[draft.start - 1, list(joints)]
        draft.quat[there] = draft.quat[draft.start - 1, list(joints)]
    elif way == "held_angles":
        draft.holds, draft.still = True, joints
        local = to_local(draft.pos, draft.quat)[1][draft.start - 1]
        draft.turn(draft.span, {index: local[None, index] for index in joints})
    else:
        draft.still = joints
        draft.turn(draft.span, rest_pose(joints))


def rest_pose(joints: tuple[int, ...]) -> dict[int, np.ndarray]:
    """Rotations of zero in a file: limbs straight, arms out to the sides."""
    turns = {index: rotation.IDENTITY[None] for index in joints}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        if body(f"{side}_shoulder") in turns:
            out = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), sign * np.pi / 2)
            turns[body(f"{side}_shoulder")] = out[None]
    return turns


def swapped_sides(draft: Draft) -> None:
    """Left and right legs, arms or both change places."""
    limbs = [LIMBS[:2], LIMBS[2:], (LIMBS[0] + LIMBS[2], LIMBS[1] + LIMBS[3])][int(draft.rng.integers(3))]
    left, right = list(limbs[0]), list(limbs[1])
    for values in (draft.pos, draft.quat):
        values[draft.span, left + right] = values[draft.span, right + left]


def spike(draft: Draft) -> None:
    """One joint is elsewhere for one to three frames; or its rotation is, and what is below it follows."""
    index = int(draft.rng.integers(1, len(BODIES)))
    draft.stop = min(draft.stop, draft.start + 3)
    if draft.rng.integers(2):
        draft.pos[draft.span, index] += draft.size(SPIKE_M) * draft.direction()
        return
    turn = rotation.from_axis_angle(draft.direction(), draft.size(SPIKE_RAD))
    local = to_local(draft.pos, draft.quat)[1][draft.span, index]
    draft.turn(draft.span, {index: rotation.multiply(local, turn)})


def noise(draft: Draft) -> None:
    """Joints shake from frame to frame: one, a limb or all; by position, or by rotation with what is below."""
    which = int(draft.rng.integers(3))
    joints = (
        (int(draft.rng.integers(1, len(BODIES))),),
        LIMBS[int(draft.rng.integers(len(LIMBS)))],
        EVERY[1:],
    )[which]
    count = draft.stop - draft.start
    if draft.rng.integers(2):
        draft.pos[draft.span, list(joints)] += draft.rng.normal(0.0, draft.size(0.015), (count, len(joints), 3))
        return
    local = to_local(draft.pos, draft.quat)[1][draft.span]
    size = draft.size(np.deg2rad(5.0), high=6.0)
    shakes = rotation.from_rotvec(draft.rng.normal(0.0, size, (count, len(joints), 3)))
    draft.turn(draft.span, {index: rotation.multiply(local[:, index], shakes[:, n]) for n, index in enumerate(joints)})


def blended_sign_flip(draft: Draft) -> None:
    """Frames between q and -q were interpolated by component: half way the rotation is any, or no rotation."""
    index = int(draft.rng.integers(1, len(BODIES)))
    draft.stop = min(draft.stop, draft.start + 2)
    local = to_local(draft.pos, draft.quat)[1]
    before, after = local[draft.start - 1, index], local[draft.stop, index]
    after = after if np.dot(before, after) < 0.0 else -after
    share = draft.rng.uniform(0.4, 0.6, (draft.stop - draft.start, 1))
    blended = (1.0 - share) * before + share * after
    if draft.rng.integers(2):
        draft.quat[draft.span, index] = blended
    else:
        draft.turn(draft.span, {index: rotation.normalize(blended + 1e-9)})


def blended_euler_wrap(draft: Draft) -> None:
    """Frames between +180 and -180 degrees were interpolated: an angle runs all the way round."""
    index = int(draft.rng.integers(1, len(BODIES)))
    draft.stop = min(draft.stop, draft.start + 5)
    count = draft.stop - draft.start
    angle = draft.rng.choice([-1.0, 1.0]) * 2.0 * np.pi * (np.arange(count) + draft.rng.uniform(0.1, 0.9)) / count
    axis = np.eye(3)[int(draft.rng.integers(3))]
    local = to_local(draft.pos, draft.quat)[1][draft.span, index]
    draft.turn(draft.span, {index: rotation.multiply(local, rotation.from_axis_angle(axis, angle))})


def frozen(draft: Draft) -> None:
    """The whole recording holds one frame and goes on where it would have been."""
    draft.holds, draft.still, draft.still_in_world = True, EVERY, True
    draft.pos[draft.span], draft.quat[draft.span] = draft.pos[draft.start - 1], draft.quat[draft.start - 1]


def doubled_stretch(draft: Draft) -> None:
    """In a stretch every second frame is that before it; it matters where the body moves by 3 cm in between."""
    draft.stop -= (draft.stop - draft.start) % 2
    draft.stop = max(draft.stop, draft.start + 2)
    later = np.arange(draft.start, draft.stop, 2)
    draft.strength = float(np.linalg.norm(draft.pos[later] - draft.pos[later - 1], axis=-1).max() / SPIKE_M)
    draft.pos[later], draft.quat[later] = draft.pos[later - 1], draft.quat[later - 1]
    draft.stop = int(later[-1]) + 1


def opening_pose(draft: Draft) -> None:
    """The first frames are a T-pose, where the person stands, at the origin or in between."""
    count = min(draft.stop - draft.start, 5)
    draft.start, draft.stop = 0, count
    _at_rest(draft, draft.rng.uniform(0.0, 1.0) if draft.rng.integers(2) else 0.0)


def origin_loss(draft: Draft) -> None:
    """Tracking loss: everything in the pose of rest at the origin, for a while or to the end."""
    if draft.rng.random() < 0.3:
        draft.stop = len(draft.pos)
    _at_rest(draft, 1.0)


def _at_rest(draft: Draft, to_origin: float) -> None:
    """The pose of rest, upright, at a share of the way from the person to the origin."""
    here = draft.pos[draft.stop if draft.stop < len(draft.pos) else draft.start - 1, 0].copy()
    draft.turn(draft.span, rest_pose(EVERY[1:]))
    back = rotation.conjugate(draft.quat[draft.span, :1])
    there = here * [1.0 - to_origin, 1.0 - to_origin, 1.0]
    draft.pos[draft.span] = there + rotation.rotate(back, draft.pos[draft.span] - draft.pos[draft.span, :1])
    draft.quat[draft.span] = rotation.multiply(back, draft.quat[draft.span])
