"""Correct the targets of the second IK pass for errors of the first: soles below ground, limbs that collide."""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET
from pipeline.quality.retargeting import LIMBS
from pipeline.retarget.foot_plan import YAW, Sole, Z
from pipeline.retarget.foot_spacing import faded, space_swings
from pipeline.retarget.settings import ClearanceSettings
from pipeline.retarget.targets import Targets
from pipeline.robot import Kinematics, LinkPoses, Robot

ARM_POINTS = (0.0, 0.35, 0.7, 1.0)
"""Points along the forearm, as fractions of the distance from elbow to hand."""

OUTER_POINTS = slice(2, None)
"""Indices of the forearm points that are also kept away from the trunk."""

SHANK_POINTS = (0.25, 0.5, 0.75)
"""Points along the shank, as fractions of the distance from knee to ankle."""

CROSSED_GAIN = 3.5
"""Outward shift of a foot / missing clearance of its shank, whose upper end moves less than the foot."""

RAISED = 1.5
"""Raise of the pelvis target on a smoothed path / depth of a sole below ground; the IK follows only in part."""

ARMS = [limb for limb, (name, _, _) in enumerate(LIMBS) if name.endswith(("upper_arm", "forearm"))]
"""Indices of the arm segments in `LIMBS`."""

ARM_SIDES = [FEET.index(LIMBS[limb][0].split("_")[0]) for limb in ARMS]
"""Side of each of `ARMS`: 0 left, 1 right."""

SHORTEST_LEVER = 0.1
"""Least lever arm [m] from the shoulder; points closer to it are turned as if they were at this distance."""


def arm_turns(
    kinematics: Kinematics, poses: LinkPoses, robot: Robot, settings: ClearanceSettings, spread: float
) -> Float[np.ndarray, "t 2 3"]:
    """Rotation vectors [rad], world frame, about the shoulders (left, right) that move the arms out of thighs and
    trunk.

    Args:
        kinematics: kinematics of the robot
        poses: link poses of the first pass
        robot: the robot
        settings: clearance distances
        spread: fade-in and fade-out of a turn [frames]
    """
    human = robot.human
    names = [human[f"{side}_{part}"] for part in ("shoulder", "elbow", "hip", "knee") for side in FEET]
    places_w = kinematics.site_pos_w(poses, [*names, *robot.hands])
    shoulder_w, elbow_w, hip_w, knee_w, hand_w = (places_w[:, None, 2 * part : 2 * part + 2] for part in range(5))
    top_w, bottom_w = shoulder_w.mean(axis=2, keepdims=True), hip_w.mean(axis=2, keepdims=True)
    trunk_quat_w = poses.quat_w[:, robot.link(human["trunk"])]
    left_w = rotation.rotate(trunk_quat_w, np.array([0.0, 1.0, 0.0]))
    outward_w = np.stack([left_w, -left_w], axis=1)
    shares = np.array(ARM_POINTS)[:, None, None]
    point_w = elbow_w + shares * (hand_w - elbow_w)
    away_w = point_w - _closest_on_segment(point_w, hip_w, knee_w)
    direction_w = _sideways_or_shortest(away_w, outward_w[:, None], settings.arm_distance / 2.0)
    from_thigh = _turn_by(
        point_w - shoulder_w, clearing_distance(away_w, direction_w, settings.arm_distance) * direction_w
    )
    outer_w = point_w[:, OUTER_POINTS]
    away_w = outer_w - _closest_on_segment(outer_w, bottom_w, top_w)
    direction_w = rotation.normalize(away_w)
    from_trunk = _turn_by(
        outer_w - shoulder_w, clearing_distance(away_w, direction_w, settings.trunk_distance) * direction_w
    )
    turns = np.concatenate([np.zeros_like(from_thigh[:, :1]), from_thigh, from_trunk], axis=1)
    largest = rotation.length(turns).argmax(axis=1)
    turn = np.take_along_axis(turns, largest[:, None, :, None], axis=1)[:, 0]
    size = faded(rotation.length(turn), spread)
    return size[..., None] * rotation.normalize(gaussian_filter1d(turn, 2.0 * spread, axis=0, mode="nearest"))


def shank_overlap(
    kinematics: Kinematics, poses: LinkPoses, robot: Robot, settings: ClearanceSettings
) -> Float[np.ndarray, " t"]:
    """Missing clearance [m], 0 or more, between the shank of one leg and the thigh of the other, per frame."""
    names = [robot.human[f"{side}_{part}"] for part in ("hip", "knee", "ankle") for side in FEET]
    places_w = kinematics.site_pos_w(poses, names)
    hip_w, knee_w, ankle_w = (places_w[:, None, 2 * part : 2 * part + 2] for part in range(3))
    point_w = knee_w + np.array(SHANK_POINTS)[:, None, None] * (ankle_w - knee_w)
    away_w = point_w - _closest_on_segment(point_w, hip_w[:, :, ::-1], knee_w[:, :, ::-1])
    return np.maximum(settings.leg_distance - rotation.length(away_w), 0.0).max(axis=(1, 2))


def through_stances(
    way: Float[np.ndarray, " t"], contact: Bool[np.ndarray, " t"], spread: int
) -> Float[np.ndarray, " t"]:
    """`way` made constant in each stance (its maximum over the stance +- `spread` frames) and blended in swings."""
    result = np.zeros(len(way))
    for start, stop in time_series.runs(contact):
        result[start:stop] = way[max(start - spread, 0) : stop + spread].max()
    for start, stop in time_series.runs(~contact):
        before = result[start - 1] if start > 0 else (result[stop] if stop < len(way) else way.max())
        after = result[stop] if stop < len(way) else before
        along = (np.arange(start, stop) - start + 1) / (stop - start + 1)
        result[start:stop] = before + (after - before) * time_series.smoothstep(along)
    return result


def clearing_distance(
    away: Float[np.ndarray, "*n 3"], direction: Float[np.ndarray, "*n 3"], distance: float
) -> Float[np.ndarray, "*n 1"]:
    """Distance s >= 0 [m] along the unit vector `direction` at which |away + s direction| = `distance`; 0 if already so
    far."""
    along = _dot(away, direction)
    lacking = distance**2 - _dot(away, away)
    return np.where(lacking > 0.0, np.sqrt(np.maximum(along**2 + lacking, 0.0)) - along, 0.0)


def _sideways_or_shortest(
    away_w: Float[np.ndarray, "*n 3"], outward_w: Float[np.ndarray, "*#n 3"], beside: float
) -> Float[np.ndarray, "*n 3"]:
    """Direction out of the thigh: outward at `beside` [m] or more outside its line, along `away_w` on its inside.

    A hand over a raised thigh would have to pass through it on its way outward.
    """
    share = np.clip(_dot(away_w, outward_w) / beside, 0.0, 1.0)
    mixed_w = rotation.normalize(share * outward_w + (1.0 - share) * rotation.normalize(away_w))
    return np.where(share < 1.0, mixed_w, outward_w)


def _turn_by(arm: Float[np.ndarray, "*n 3"], way: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Rotation vector [rad] that moves the end of `arm` [m] by `way` [m], to first order."""
    lever = np.maximum(rotation.length(arm)[..., None], SHORTEST_LEVER)
    return rotation.cross(arm, way) / lever**2


def _closest_on_segment(
    point: Float[np.ndarray, "*n 3"], start: Float[np.ndarray, "*#n 3"], stop: Float[np.ndarray, "*#n 3"]
) -> Float[np.ndarray, "*n 3"]:
    line = stop - start
    share = np.clip(_dot(point - start, line) / _dot(line, line), 0.0, 1.0)
    return start + share * line


def _dot(a: Float[np.ndarray, "*#n 3"], b: Float[np.ndarray, "*#n 3"]) -> Float[np.ndarray, "*#n 1"]:
    products = a * b
    return products[..., :1] + products[..., 1:2] + products[..., 2:]


def corrected_targets(
    targets: Targets, poses: LinkPoses, robot: Robot, sole: Sole, settings: ClearanceSettings, fps: float
) -> Targets:
    """Correct the targets by the errors of the first pass.

    Feet: the stance error and the depth of the lowest sole corner are added to the target, and swinging feet are
    moved apart where they come too close. Pelvis: raised by that depth where it follows a smoothed path, because legs
    at their limits cannot lift the soles. Arms: turned about the shoulder, out of thigh and trunk.

    Args:
        targets: targets of the first pass
        poses: link poses that the first pass reached
        robot: the robot
        sole: its sole
        settings: clearances and limits of the corrections
        fps: frame rate [Hz]
    """
    kinematics = Kinematics(robot)
    spread = settings.spread_s * fps
    pelvis_pos_w, limb_dir_w = targets.pelvis_pos_w.copy(), targets.limb_dir_w.copy()
    turns = rotation.from_rotvec(arm_turns(kinematics, poses, robot, settings, spread))
    limb_dir_w[:, ARMS] = rotation.rotate(turns[:, ARM_SIDES], limb_dir_w[:, ARMS])
    corners_w = kinematics.site_pos_w(poses, [name for names in robot.sole_corners for name in names])
    lowest = corners_w[..., 2].reshape(len(corners_w), 2, -1).min(axis=2)
    sunk = faded(np.maximum(-lowest, 0.0), spread)
    foot_pos_w = targets.foot_pos_w + _foot_correction(targets, poses, robot, settings)
    foot_pos_w[..., 2] += sunk
    foot_pos_w += _swings_apart(targets, poses, robot, sole, settings, spread).swapaxes(0, 1)
    for side in range(2):
        pelvis_pos_w[:, 2] += RAISED * targets.pelvis_smoothed * sunk[:, side]
    crossed = shank_overlap(kinematics, poses, robot, settings)
    if crossed.any():
        heading = rotation.yaw_of(poses.quat_w[:, robot.link(robot.human["pelvis"])])
        left_w = np.stack([-np.sin(heading), np.cos(heading), np.zeros_like(heading)], axis=1)
        for side, sign in ((0, 1.0), (1, -1.0)):
            way = CROSSED_GAIN * through_stances(crossed, targets.contacts[:, side], round(spread))
            foot_pos_w[:, side] += sign * way[:, None] * left_w
    return dataclasses.replace(targets, foot_pos_w=foot_pos_w, pelvis_pos_w=pelvis_pos_w, limb_dir_w=limb_dir_w)


def _foot_correction(
    targets: Targets, poses: LinkPoses, robot: Robot, settings: ClearanceSettings
) -> Float[np.ndarray, "t 2 3"]:
    """Clipped position error [m] of the first pass in stances; zero in swings."""
    reached_w = poses.pos_w[:, _foot_links(robot)]
    missed = np.clip(targets.foot_pos_w - reached_w, -settings.highest_correction, settings.highest_correction)
    return np.where(targets.contacts[..., None], settings.correction_share * missed, 0.0)


def _swings_apart(
    targets: Targets, poses: LinkPoses, robot: Robot, sole: Sole, settings: ClearanceSettings, spread: float
) -> Float[np.ndarray, "2 t 3"]:
    """Outward shifts [m] of swinging feet where the feet of the first pass come too close."""
    heading = rotation.yaw_of(poses.quat_w[:, robot.link(robot.human["pelvis"])])
    links = _foot_links(robot)
    toes_w = rotation.rotate(poses.quat_w[:, links].swapaxes(0, 1), np.array([1.0, 0.0, 0.0]))
    feet = np.zeros((*toes_w.shape[:2], 5))
    feet[..., : Z + 1] = poses.pos_w[:, links].swapaxes(0, 1)
    feet[..., YAW] = np.arctan2(toes_w[..., 1], toes_w[..., 0])
    pushed = feet.copy()
    space_swings(pushed, targets.contacts, heading, sole, settings.foot_gap, spread)
    return pushed[..., : Z + 1] - feet[..., : Z + 1]


def _foot_links(robot: Robot) -> list[int]:
    return [robot.link(robot.human[f"{side}_foot"]) for side in FEET]
