"""A torque-speed sweep of one motor, at the joint, in SI units, as magnitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """N points of driving torque over speed, sorted by speed."""

    motor: str
    speed: Float[np.ndarray, " n"]
    """[rad/s], 0 or more, at the joint."""
    torque: Float[np.ndarray, " n"]
    """Largest torque in the direction of motion [N m], at the joint."""
    forward: Bool[np.ndarray, " n"]
    """Whether the joint turned in its positive direction."""
    about: dict[str, str]
    """Statements of the file's comment lines, by name."""
    notes: tuple[str, ...]
    """Changes made to the file's numbers."""

    @property
    def synthetic(self) -> bool:
        """Whether the file states that it was never measured."""
        return "synthetic" in self.about

    def direction(self, forward: bool) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """Speeds and torques of one direction."""
        chosen = self.forward == forward
        return self.speed[chosen], self.torque[chosen]
