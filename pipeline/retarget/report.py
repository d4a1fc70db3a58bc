"""The numbers a retargeted clip carries on."""

from __future__ import annotations

import numpy as np

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality import retargeting
from pipeline.retarget.targets import Targets
from pipeline.robot import Kinematics, LinkPoses, Robot


def numbers_of(clip: RobotClip, human: HumanClip, targets: Targets, robot: Robot) -> dict[str, float]:
    """Numbers by name; angles in degrees, all else SI. `human` is the clip at the robot's rate."""
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
        **_foot_numbers(kinematics, poses, clip, robot),
        **_velocity_numbers(poses, clip, robot),
    }


def _foot_numbers(kinematics: Kinematics, poses: LinkPoses, clip: RobotClip, robot: Robot) -> dict[str, float]:
    soles_w = kinematics.site_pos_w(poses, robot.feet)
    corners_w = kinematics.site_pos_w(poses, (*robot.sole_corners[0], *robot.sole_corners[1]))
    speed = np.linalg.norm(time_series.derivative(soles_w[..., :2], clip.fps), axis=-1)
    interior = np.stack([_interior(clip.contacts[:, side]) for side in range(2)], axis=-1)
    drifts = np.concatenate([retargeting.stance_drifts(soles_w[:, side], clip.contacts[:, side]) for side in range(2)])
    return {
        "slip_m_s": float(speed[interior].mean()) if interior.any() else 0.0,
        "drift_m": float(drifts.mean()) if len(drifts) else 0.0,
        "penetration_m": float(max(0.0, -corners_w[..., 2].min())),
    }


def _interior(contact: np.ndarray) -> np.ndarray:
    """Contact frames whose neighbours are contact frames, so that central differences see the stance alone."""
    before, after = np.roll(contact, 1), np.roll(contact, -1)
    before[0] = after[-1] = False
    return contact & before & after


def _velocity_numbers(poses: LinkPoses, clip: RobotClip, robot: Robot) -> dict[str, float]:
    """Mean velocity of the pelvis link in its own heading, the robot's command as it turned out."""
    pelvis = robot.link(robot.human["pelvis"])
    yaw = np.unwrap(rotation.yaw_of(poses.quat_w[:, pelvis]))
    velocity_w = time_series.derivative(poses.pos_w[:, pelvis], clip.fps)
    velocity = rotation.rotate_inverse(rotation.about_z(yaw), velocity_w).mean(axis=0)
    return {
        "forward_m_s": float(velocity[0]),
        "lateral_m_s": float(velocity[1]),
        "yaw_rate_rad_s": float(time_series.derivative(yaw, clip.fps).mean()),
    }
