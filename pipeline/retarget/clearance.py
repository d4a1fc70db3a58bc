"""What the first pass got wrong is put into the targets of the second: soles under ground, arms in the body."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import FEET
from pipeline.quality.retargeting import LIMBS
from pipeline.retarget import arm_clearance
from pipeline.retarget.foot_plan import Sole
from pipeline.retarget.foot_spacing import faded, space_swings
from pipeline.retarget.settings import ClearanceSettings
from pipeline.retarget.targets import Targets
from pipeline.robot import Kinematics, LinkPoses, Robot


def cleared(
    targets: Targets, poses: LinkPoses, robot: Robot, sole: Sole, settings: ClearanceSettings, fps: float
) -> Targets:
    """Targets corrected by what the poses of the first pass show.

    Feet: the stance error and the depth of the lowest sole corner are added to the target, and swinging feet go further
    apart where they come too close. Arms: turned about the shoulder, out of thigh and trunk.
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
        turn = rotation.from_rotvec(arm_clearance.turn_of(side, kinematics, poses, robot, settings, spread))
        for limb, (name, _, _) in enumerate(LIMBS):
            if name in (f"{FEET[side]}_upper_arm", f"{FEET[side]}_forearm"):
                limb_dir_w[:, limb] = rotation.rotate(turn, limb_dir_w[:, limb])
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
