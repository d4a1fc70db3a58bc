"""What torque a joint's motor can give at a speed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class TorqueEnvelope:
    """Limits of J joints. Constant to the knee speed, then falling in a line through 0 at the no-load speed.

    Only a torque that drives the motion on falls with speed; one that brakes it keeps the full limit. A joint that is
    driven beyond the no-load speed from outside is braked by its motor, by the limit at most: the line continues to it.
    This is the DC-motor form of mjlab and Isaac Lab (pipeline/actuators/adapted_robot.py).
    """

    limit: Float[np.ndarray, " j"]
    """Torque below the knee speed [N m]."""
    knee_speed: Float[np.ndarray, " j"] | None = None
    """Speed from which the torque falls [rad/s]; None for a constant limit."""
    no_load_speed: Float[np.ndarray, " j"] | None = None
    """Speed at which it is 0 [rad/s]."""

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
        """The torque [N m] that the motors give when `torque` is commanded."""
        lower, upper = self.bounds(speed)
        return np.minimum(np.maximum(torque, lower), upper)


@dataclass(frozen=True, kw_only=True)
class PdControl:
    """kp (target - position) - kd velocity, cut to the envelope; kp in N m/rad, kd in N m s/rad."""

    kp: Float[np.ndarray, " j"]
    kd: Float[np.ndarray, " j"]
    envelope: TorqueEnvelope

    def torque(self, target: np.ndarray, joint_pos: np.ndarray, joint_vel: np.ndarray) -> Float[np.ndarray, " j"]:
        """Torque [N m] (j,) for target and position [rad] and velocity [rad/s]."""
        return self.envelope.clip(self.kp * (target - joint_pos) - self.kd * joint_vel, joint_vel)
