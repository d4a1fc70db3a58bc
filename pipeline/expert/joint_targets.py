"""The joint targets by which position control would give the torques that a motion of the database needs."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.expert.frames import FPS
from pipeline.quality.sole import SoleMotion, sole_motion
from pipeline.quality.sole_contact import CONTACT_HEIGHT, OFF_SPEED
from pipeline.robot import Robot
from pipeline.simulation.contact_wrench import solve_contacts
from pipeline.simulation.inverse_dynamics import motion_forces, states

CUTOFF_HZ = 10.0
"""Of the motion's accelerations: with less, running loses its impacts, with more they are mostly noise."""
FRICTION = 1.0
EXCESS_WEIGHT = 10.0
"""What torque past a limit costs against the root's residual: what motors can't give is no target."""
REACH = 2
"""Forces are sought this many frames around a contact: an acceleration is over three frames."""


def joint_targets(frames: Float[np.ndarray, "t c"], robot: Robot) -> Float[np.ndarray, "t j"]:
    """Targets [rad] of all joints: q + (tau + kd dq) / kp, with the torques of inverse dynamics cut to their limits.

    Contacts are told from the soles. `frames` are those of `pipeline/expert/frames.py`; joints that the policy doesn't
    move are at their default. Followed blindly these targets let the robot fall within a second: they say how a
    motion looks from inside, not how to keep one's balance.
    """
    clip = _clip_of(frames, robot)
    sole = sole_motion(clip, robot)
    series = states(clip.root_pos_w, clip.root_quat_w, clip.joint_pos, FPS, CUTOFF_HZ)
    solution = solve_contacts(
        robot,
        motion_forces(robot, series),
        clip.root_pos_w,
        sole.corner_pos_w,
        _touching(sole),
        friction=FRICTION,
        excess_weight=EXCESS_WEIGHT,
        heading=rotation.yaw_of(clip.root_quat_w),
    )
    torque = np.clip(solution.joint_torque, -robot.torque_limit, robot.torque_limit)
    joint_vel = series.qvel[:, 6:]
    return clip.joint_pos + (torque + robot.kd * joint_vel) / robot.kp


def _clip_of(frames: Float[np.ndarray, "t c"], robot: Robot) -> RobotClip:
    count = len(robot.controlled)
    joint_pos = np.tile(robot.default_joint_pos, (len(frames), 1))
    joint_pos[:, [robot.joint(name) for name in robot.controlled]] = frames[:, 7 : 7 + count]
    return RobotClip(
        name="expert",
        fps=FPS,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=frames[:, :3].astype(float),
        root_quat_w=rotation.normalize(frames[:, 3:7].astype(float)),
        joint_pos=joint_pos,
        contacts=None,
    )


def _touching(sole: SoleMotion) -> Bool[np.ndarray, "t 2 4"]:
    """Corners that may bear a force: low and slow ones, and those that are so within REACH frames."""
    slow = np.linalg.norm(sole.corner_vel_w[..., :2], axis=-1) < OFF_SPEED
    bearing = (sole.corner_pos_w[..., 2] < CONTACT_HEIGHT) & slow
    touching = bearing.copy()
    for away in range(1, REACH + 1):
        touching[away:] |= bearing[:-away]
        touching[:-away] |= bearing[away:]
    return touching
