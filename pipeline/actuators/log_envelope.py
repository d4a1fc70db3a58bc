"""Torques and speeds reached in a log, compared with the calibrated limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.actuators.adapted_robot import JointActuator, torque_envelope

BINS = 20
"""Number of speed bins over the range of the log."""
TORQUE_MARGIN = 0.05
"""Share of the limit by which an estimated torque may exceed it: current sensors and gear losses."""
SPEED_MARGIN = 0.05
"""Share of the limit by which a speed may exceed it: differences of an encoder."""


@dataclass(frozen=True, kw_only=True)
class JointLog:
    """Range of one joint in a log of n samples."""

    joint: str
    bin_speed: Float[np.ndarray, " b"]
    """Middles of the bins of |speed| [rad/s]."""
    reached_torque: Float[np.ndarray, " b"]
    """Largest torque in the direction of motion in each bin [N m]; NaN without samples."""
    max_speed: float
    """[rad/s]"""
    max_torque: float
    """Largest torque, driving or braking [N m]."""
    over_torque: int
    """Samples with a torque beyond the envelope at their speed, by more than the margin."""
    over_speed: int
    """Samples faster than the box's limit, by more than the margin."""
    worst_torque_excess: float
    """Largest torque beyond the envelope over the effort limit; 0 if none is."""

    @property
    def holds(self) -> bool:
        return not self.over_torque and not self.over_speed

    def text(self, samples: int) -> str:
        """One line for a report."""
        if self.holds:
            return f"{self.joint} stays within its calibrated limits"
        return (
            f"{self.joint}: {self.over_torque} of {samples} samples give more torque than calibrated (worst by "
            f"{100 * self.worst_torque_excess:.0f} % of the limit), {self.over_speed} are faster"
        )


def log_envelope(
    actuators: Sequence[JointActuator], joint_vel: Float[np.ndarray, "n j"], joint_torque: Float[np.ndarray, "n j"]
) -> tuple[JointLog, ...]:
    """The range of each joint in a log, in the actuators' order.

    Samples with a speed or a torque that is not finite are left out. Raises ValueError for arrays that are not of the
    actuators' joints.

    Args:
        joint_vel: [rad/s]
        joint_torque: estimated torque at the joints [N m]
    """
    if joint_vel.shape != joint_torque.shape or joint_vel.shape[1] != len(actuators):
        raise ValueError(f"the log is {joint_vel.shape} and {joint_torque.shape}, of {len(actuators)} joints.")
    lower, upper = torque_envelope(actuators).bounds(joint_vel)
    found = []
    for index, actuator in enumerate(actuators):
        speed, torque = joint_vel[:, index], joint_torque[:, index]
        kept = np.isfinite(speed) & np.isfinite(torque)
        excess = np.maximum(torque - upper[:, index], lower[:, index] - torque)[kept] / actuator.box_effort_limit
        found.append(_joint(actuator, speed[kept], torque[kept], excess))
    return tuple(found)


def _joint(actuator: JointActuator, speed: np.ndarray, torque: np.ndarray, excess: np.ndarray) -> JointLog:
    fast = np.abs(speed)
    edges = np.linspace(0.0, max(float(fast.max(initial=0.0)), 1e-6), BINS + 1)
    place = np.minimum(np.searchsorted(edges, fast, side="right") - 1, BINS - 1)
    reached = np.full(BINS, -np.inf)
    np.maximum.at(reached, place, torque * np.where(speed < 0.0, -1.0, 1.0))
    return JointLog(
        joint=actuator.joint,
        bin_speed=0.5 * (edges[1:] + edges[:-1]),
        reached_torque=np.where(np.isfinite(reached), reached, np.nan),
        max_speed=float(fast.max(initial=0.0)),
        max_torque=float(np.abs(torque).max(initial=0.0)),
        over_torque=int(np.sum(excess > TORQUE_MARGIN)),
        over_speed=int(np.sum(fast > (1.0 + SPEED_MARGIN) * actuator.box_velocity_limit)),
        worst_torque_excess=float(max(excess.max(initial=0.0), 0.0)),
    )
