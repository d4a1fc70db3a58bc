"""Joint torque of a PD controller behind a motor's limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline.simulation.torque_envelope import TorqueEnvelope


@dataclass(frozen=True, kw_only=True)
class PdControl:
    """kp (target - position) - kd velocity, cut to the envelope."""

    kp: Float[np.ndarray, " j"]
    """[N m/rad]"""
    kd: Float[np.ndarray, " j"]
    """[N m s/rad]"""
    envelope: TorqueEnvelope

    def torque(self, target: np.ndarray, joint_pos: np.ndarray, joint_vel: np.ndarray) -> Float[np.ndarray, " j"]:
        """Torque [N m] (j,) for target and position [rad] and velocity [rad/s]."""
        return self.envelope.clip(self.kp * (target - joint_pos) - self.kd * joint_vel, joint_vel)
