"""What the first pass got wrong is put into the targets of the second: soles under ground, arms in the thighs."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import FEET
from pipeline.quality.retargeting import LIMBS
from pipeline.retarget.foot_plan import Sole
from pipeline.retarget.foot_spacing import faded, space_swings
from pipeline.retarget.settings import ClearanceSettings
from pipeline.retarget.targets import Targets
from pipeline.robot import Kinematics, LinkPoses, Robot

ARM_POINTS = (0.0, 0.35, 0.7, 1.0)
"""Points along the forearm, from elbow to hand, that are kept out of the thigh."""

SHORTEST_LEVER = 0.1
"""[m] Points closer to the shoulder than this are turned as if they were this far."""


def cleared(
    targets: Targets, poses: LinkPoses, robot: Robot, sole: Sole, settings: ClearanceSettings, fps: float
) -> Targets:
    """Targets corrected by what the poses of the first pass show.

    Feet: the stance error and the depth of the lowest sole corner are added to the target. Arms: turned outward about
    the trunk's x axis by the angle that takes forearm and hand out of the thigh of their side.
    """
    kinematics = Kinematics(robot)
    spread = settings.spread_s * fps
    foot_pos_w, limb_dir_w = targets.foot_pos_w.copy(), targets.limb_dir_w.copy()
    apart_w = _swings_apart(targets, poses, robot, sole, settings, spread)
    for side in range(2):
        foot_pos_w[:, side] += _foot_correction(side, targets, poses, robot, settings)
        corners_w = kinematics.site_pos_w(poses, robot.sole_corners[side])
        foot_pos_w[:, side, 2] += faded(np.maximum(-corners_w[..., 2].min(axis=1), 0.0), spread)
        foot_pos_w[:, side] += apart_w[side]
        angle = faded(_arm_angle(side, kinematics, poses, robot, settings), spread)
        _turn_arm_out(limb_dir_w, side, angle, targets.trunk_quat_w)
    return dataclasses.replace(targets, foot_pos_w=foot_pos_w, limb_dir_w=limb_dir_w)


def _foot_correction(
    side: int, targets: Targets, poses: LinkPoses, robot: Robot, settings: ClearanceSettings
) -> Float[np.ndarray, "t 3"]:
    """What the first pass missed in stances, no more than the setting allows; zero in swings."""
    reached_w = poses.pos_w[:, robot.link(robot.human[f"{FEET[side]}_foot"])]
    missed = np.clip(targets.foot_pos_w[:, side] - reached_w, -settings.highest_correction, settings.highest_correction)
    return np.where(targets.contacts[:, side, None], settings.correction_share * missed, 0.0)


def _swings_apart(
    targets: Targets, poses: LinkPoses, robot: Robot, sole: Sole, settings: ClearanceSettings, spread: float
) -> tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 3"]]:
    """Ways [m] by which swinging feet go further outward where the first pass's feet come too close."""
    heading = rotation.yaw_of(poses.quat_w[:, robot.link(robot.human["pelvis"])])
    feet = []
    for name in FEET:
        link = robot.link(robot.human[f"{name}_foot"])
        toes_w = rotation.rotate(poses.quat_w[:, link], np.array([1.0, 0.0, 0.0]))
        yaw = np.arctan2(toes_w[:, 1], toes_w[:, 0])
        feet.append(np.column_stack([poses.pos_w[:, link], yaw, np.zeros_like(yaw)]))
    pushed = [foot.copy() for foot in feet]
    space_swings((pushed[0], pushed[1]), targets.contacts, heading, sole, settings.foot_gap, spread)
    return pushed[0][:, :3] - feet[0][:, :3], pushed[1][:, :3] - feet[1][:, :3]


def _arm_angle(
    side: int, kinematics: Kinematics, poses: LinkPoses, robot: Robot, settings: ClearanceSettings
) -> Float[np.ndarray, " t"]:
    """Angle [rad], 0 or more, about the shoulder that takes the arm out of the thigh's capsule."""
    name, human = FEET[side], robot.human
    sites = (human[f"{name}_shoulder"], human[f"{name}_elbow"], robot.hands[side])
    shoulder_w, elbow_w, hand_w = np.moveaxis(kinematics.site_pos_w(poses, sites), 1, 0)
    hip_w, knee_w = np.moveaxis(kinematics.site_pos_w(poses, (human[f"{name}_hip"], human[f"{name}_knee"])), 1, 0)
    outward_w = rotation.rotate(poses.quat_w[:, robot.link(human["trunk"])], np.array([0.0, 1.0 - 2.0 * side, 0.0]))
    angle = np.zeros(len(hip_w))
    for share in ARM_POINTS:
        point_w = elbow_w + share * (hand_w - elbow_w)
        away_w = point_w - _closest_on_segment(point_w, hip_w, knee_w)
        lever = np.maximum(np.linalg.norm(point_w - shoulder_w, axis=-1), SHORTEST_LEVER)
        angle = np.maximum(angle, _way_out(away_w, outward_w, settings.arm_distance) / lever)
    return angle


def _turn_arm_out(
    limb_dir_w: Float[np.ndarray, "t 8 3"], side: int, angle: Float[np.ndarray, " t"], trunk_quat_w: np.ndarray
) -> None:
    forward_w = rotation.rotate(trunk_quat_w, np.array([1.0, 0.0, 0.0]))
    turn = rotation.from_rotvec(forward_w * (angle if side == 0 else -angle)[:, None])
    for limb, (name, _, _) in enumerate(LIMBS):
        if name in (f"{FEET[side]}_upper_arm", f"{FEET[side]}_forearm"):
            limb_dir_w[:, limb] = rotation.rotate(turn, limb_dir_w[:, limb])


def _way_out(away: np.ndarray, outward: np.ndarray, distance: float) -> Float[np.ndarray, " t"]:
    """Way s >= 0 [m] along unit `outward` with |away + s outward| = `distance`, where |away| is less than that."""
    along = np.sum(away * outward, axis=-1)
    lacking = distance**2 - np.sum(away * away, axis=-1)
    return np.where(lacking > 0.0, np.sqrt(np.maximum(along**2 + lacking, 0.0)) - along, 0.0)


def _closest_on_segment(point: np.ndarray, start: np.ndarray, stop: np.ndarray) -> Float[np.ndarray, "t 3"]:
    line = stop - start
    share = np.clip(np.sum((point - start) * line, axis=-1) / np.sum(line * line, axis=-1), 0.0, 1.0)
    return start + share[:, None] * line
