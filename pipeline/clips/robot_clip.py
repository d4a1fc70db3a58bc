"""A motion of a robot: root pose and joint angles over time, joints in the robot file's order."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import Frames


@dataclass(frozen=True, kw_only=True)
class SimulatedForces:
    """Forces of the simulation that made a motion, as means over the control step that begins at each frame."""

    joint_torque: Float[np.ndarray, "t j"]
    """Torque of the motors [N m]."""
    foot_wrench_w: Float[np.ndarray, "t 2 6"]
    """Force [N] and moment about the foot link's origin [N m] of the ground on the left and right foot, world frame."""
    other_force_w: Float[np.ndarray, "t 3"]
    """Force of the ground on all other links [N]."""
    push_w: Float[np.ndarray, "t 3"]
    """External force on the root link [N]: the pushes of a disturbed rollout."""

    def cut(self, start: int, stop: int) -> "SimulatedForces":
        """Frames [start, stop)."""
        return SimulatedForces(**{name: values[start:stop].copy() for name, values in vars(self).items()})


@dataclass(frozen=True, kw_only=True)
class RobotClip(Frames):
    """T frames of a robot with J joints. World: right-handed, z up, ground at z = 0."""

    name: str
    fps: float
    """Frames per second [Hz]."""
    robot: str
    """Name of the robot's folder in `robots/`."""
    joint_names: tuple[str, ...]
    """The J joints, in the robot file's order."""
    root_pos_w: Float[np.ndarray, "t 3"]
    """Position of the root link (T1: Trunk), world frame [m]."""
    root_quat_w: Float[np.ndarray, "t 4"]
    """Orientation of the root link, world frame, wxyz, sign-continuous."""
    joint_pos: Float[np.ndarray, "t j"]
    """Joint positions [rad]."""
    contacts: Bool[np.ndarray, "t 2"] | None = None
    """Intended foot contacts, (left, right); None if the source does not state them."""
    forces: SimulatedForces | None = None
    """Forces of the simulation that made the motion; None for any other motion."""

    @property
    def frame_count(self) -> int:
        return len(self.root_pos_w)

    def joint_vel(self) -> Float[np.ndarray, "t j"]:
        """Joint velocities [rad/s], central differences."""
        return time_series.derivative(self.joint_pos, self.fps)

    def root_lin_vel_w(self) -> Float[np.ndarray, "t 3"]:
        """Linear velocity of the root link's origin, world frame [m/s], central differences."""
        return time_series.derivative(self.root_pos_w, self.fps)

    def root_ang_vel_w(self) -> Float[np.ndarray, "t 3"]:
        """Angular velocity of the root link, world frame [rad/s], central differences."""
        return rotation.angular_velocity_w(self.root_quat_w, self.fps)
