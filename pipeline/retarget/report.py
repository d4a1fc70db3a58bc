"""The numbers a retargeted clip carries on."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality import retargeting
from pipeline.quality.command_velocity import command_velocity
from pipeline.quality.foot_slip import inner_contacts
from pipeline.retarget.targets import Targets
from pipeline.robot import Kinematics, LinkPoses, Robot


def numbers_of(clip: RobotClip, human: HumanClip, targets: Targets, robot: Robot) -> dict[str, float]:
    """Numbers by name; angles in degrees, all else SI. `human` is the clip at the robot's rate.

    The velocities are the robot's: a human's times `leg_ratio`. Slip is that of the sole's centre.
    """
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    limbs = np.rad2deg(retargeting.limb_direction_error(human, poses, robot))
    return {
        "leg_ratio": targets.leg_ratio,
        "limb_error_deg": float(limbs.mean()),
        "thigh_error_deg": float(limbs[:, 0:2].mean()),
        "shank_error_deg": float(limbs[:, 2:4].mean()),
        "arm_error_deg": float(limbs[:, 4:].mean()),
        "trunk_error_deg": float(np.rad2deg(retargeting.trunk_orientation_error(human, poses, robot).mean())),
        "heading_error_deg": float(np.rad2deg(retargeting.pelvis_heading_error(human, poses, robot).mean())),
        "jerk_rad_s3": retargeting.joint_jerk(clip, robot.controlled),
        "jump_frames": int(retargeting.jump_frames(clip).sum()),
        **_foot_numbers(kinematics, poses, targets.contacts, clip.fps, robot),
        **velocity_of(clip),
    }


def velocity_of(clip: RobotClip) -> dict[str, float]:
    """The command that the robot's motion is: mean forward and lateral velocity [m/s], yaw rate [rad/s]."""
    return dict(vars(command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)))


def _foot_numbers(
    kinematics: Kinematics, poses: LinkPoses, contacts: Bool[np.ndarray, "t 2"], fps: float, robot: Robot
) -> dict[str, float]:
    soles_w = kinematics.site_pos_w(poses, robot.feet)
    corners_w = kinematics.site_pos_w(poses, (*robot.sole_corners[0], *robot.sole_corners[1]))
    speed = np.linalg.norm(time_series.derivative(soles_w[..., :2], fps), axis=-1)
    interior = inner_contacts(contacts)
    drifts = np.concatenate([retargeting.stance_drifts(soles_w[:, side], contacts[:, side]) for side in range(2)])
    return {
        "slip_m_s": float(speed[interior].mean()) if interior.any() else 0.0,
        "drift_m": float(drifts.mean()) if len(drifts) else 0.0,
        "penetration_m": float(max(0.0, -corners_w[..., 2].min())),
    }
