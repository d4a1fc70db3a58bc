"""Behaviour of the deployment in a fall: the policy is stopped and the joints are only damped."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from pipeline.simulation.run import Controller

FALLEN_COS = 0.5
"""Cosine of the tilt at which booster_deploy stops its policy: 60 degrees."""


class FallGuard:
    """Forwards another controller until the trunk tilts too far; then commands the current joint positions."""

    def __init__(self, inner: Controller):
        self.inner, self.task = inner, inner.task
        self.reset()

    def reset(self) -> None:
        self.inner.reset()
        self.last_action: Float[np.ndarray, " a"] = self.inner.last_action
        self.fallen = False

    def targets(
        self,
        gyro_b: Float[np.ndarray, " 3"],
        gravity_b: Float[np.ndarray, " 3"],
        command: Float[np.ndarray, " 3"],
        joint_pos: Float[np.ndarray, " j"],
        joint_vel: Float[np.ndarray, " j"],
    ) -> Float[np.ndarray, " j"]:
        """The inner controller's targets; after a fall the current positions [rad]."""
        self.fallen = self.fallen or float(gravity_b[2]) > -FALLEN_COS
        if self.fallen:
            return np.array(joint_pos)
        targets = self.inner.targets(gyro_b, gravity_b, command, joint_pos, joint_vel)
        self.last_action = self.inner.last_action
        return targets
