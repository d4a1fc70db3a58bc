"""Torque limits of the motors as a function of speed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class TorqueEnvelope:
    """Torque limits of j joints: constant up to the knee speed, then linear to 0 at the no-load speed.

    Only driving torque decreases with speed; braking torque keeps the full limit. A joint that is driven beyond the
    no-load speed externally is braked by its motor: the line continues below 0, to the braking limit.
    This is the DC-motor form of mjlab and Isaac Lab (pipeline/actuators/adapted_robot.py).
    """

    limit: Float[np.ndarray, " j"]
    """Torque below the knee speed [N m]."""
    knee_speed: Float[np.ndarray, " j"] | None = None
    """Speed from which the torque falls [rad/s]; None for a constant limit."""
    no_load_speed: Float[np.ndarray, " j"] | None = None
    """Speed at which the driving torque is 0 [rad/s]."""

    def bounds(self, speed: Float[np.ndarray, "*t j"]) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest torque [N m] at each joint's speed [rad/s]."""
        if self.knee_speed is None or self.no_load_speed is None:
            upper = np.broadcast_to(self.limit, np.shape(speed)).astype(float)
            return -upper, upper
        width = np.maximum(self.no_load_speed - self.knee_speed, 1e-9)
        forward = self.limit * np.minimum(np.maximum((self.no_load_speed - speed) / width, -1.0), 1.0)
        backward = self.limit * np.minimum(np.maximum((self.no_load_speed + speed) / width, -1.0), 1.0)
        return -backward, forward

    def clip(self, torque: Float[np.ndarray, "*t j"], speed: Float[np.ndarray, "*t j"]) -> Float[np.ndarray, "*t j"]:
        """Limit commanded torques [N m] to those that the motors can produce."""
        lower, upper = self.bounds(speed)
        return np.minimum(np.maximum(torque, lower), upper)


@dataclass(frozen=True, kw_only=True)
class PdControl:
    """PD control kp (target - position) - kd velocity, limited to the envelope; kp in N m/rad, kd in N m s/rad."""

    kp: Float[np.ndarray, " j"]
    kd: Float[np.ndarray, " j"]
    envelope: TorqueEnvelope

    def torque(self, target: np.ndarray, joint_pos: np.ndarray, joint_vel: np.ndarray) -> Float[np.ndarray, " j"]:
        """Torque [N m] (j,) for target and position [rad] and velocity [rad/s]."""
        return self.envelope.clip(self.kp * (target - joint_pos) - self.kd * joint_vel, joint_vel)
