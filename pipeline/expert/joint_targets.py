"""The position targets that would make the motors do what a motion does: what a policy answers that moves so.

A motor that follows targets lags behind them by what its torque needs: target = q + (torque + kd dq) / kp. Torques are
those of inverse dynamics with the contact forces that explain the motion best (`simulation/contact_wrench.py`), within
the motors' limits. A retargeted motion is explained only nearly, so its targets alone don't keep a robot upright.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.expert.frames import FPS
from pipeline.expert.read import DatabaseClip
from pipeline.quality.sole import SoleMotion, sole_motion
from pipeline.robot import Robot
from pipeline.simulation.contact_wrench import solve_contacts
from pipeline.simulation.inverse_dynamics import motion_forces, states

CUTOFF_HZ = 10.0
"""Low pass before accelerations are taken: 6 Hz is usual for gait, 10 to 12 for running."""
LOW_M, SLOW = 0.02, 0.7
"""A corner of a sole may bear where it is lower [m] and slower [m/s] ..."""
REACH = 2
"""... and so many frames before and after: contacts told from motion begin and end a frame late or early."""
FRICTION = 1.0
EXCESS = 0.003
"""What torque past its limit costs against what is missing at the root: little, the motion is taken at its word."""


def joint_targets(clip: DatabaseClip, robot: Robot) -> Float[np.ndarray, "t a"]:
    """Targets [rad] of the controlled joints, to be held from each frame to the next, without a delay on the way."""
    controlled = [robot.joint_names.index(name) for name in robot.controlled]
    motion = _whole(clip, robot, controlled)
    series = states(motion.root_pos_w, motion.root_quat_w, motion.joint_pos, FPS, CUTOFF_HZ)
    sole = sole_motion(motion, robot)
    found = solve_contacts(
        robot,
        motion_forces(robot, series),
        motion.root_pos_w,
        sole.corner_pos_w,
        _bearing(sole),
        friction=FRICTION,
        excess_weight=EXCESS,
        heading=rotation.yaw_of(motion.root_quat_w),
    )
    torque = np.clip(found.joint_torque, -robot.torque_limit, robot.torque_limit)
    velocity = series.qvel[:, 6:]
    targets = _between(motion.joint_pos) + (_between(torque) + robot.kd * _between(velocity)) / robot.kp
    return targets[:, controlled]


def _whole(clip: DatabaseClip, robot: Robot, controlled: list[int]) -> RobotClip:
    """The clip with all joints; those that the database doesn't hold are at their default."""
    joint_pos = np.tile(robot.default_joint_pos, (len(clip.frames), 1))
    joint_pos[:, controlled] = clip.frames[:, 7 : 7 + len(controlled)]
    return RobotClip(
        name=clip.name,
        fps=FPS,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=clip.frames[:, :3],
        root_quat_w=rotation.normalize(clip.frames[:, 3:7]),
        joint_pos=joint_pos,
    )


def _bearing(sole: SoleMotion) -> Bool[np.ndarray, "t 2 4"]:
    """Corners that may bear a force."""
    speed = np.linalg.norm(sole.corner_vel_w[..., :2], axis=-1)
    found = (sole.corner_pos_w[..., 2] < LOW_M) & (speed < SLOW)
    reached = found.copy()
    for away in range(1, REACH + 1):
        reached[away:] |= found[:-away]
        reached[:-away] |= found[away:]
    return reached


def _between(values: np.ndarray) -> np.ndarray:
    """Means of each row and the next; the last stands alone."""
    return 0.5 * (values + np.concatenate([values[1:], values[-1:]]))
