"""A row of the task reward: what it pays, its weight, and how that grows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

FALL = -200.0
"""The paper's weight of a fall."""
ENDS = ("termination", "stalled")
"""Rows that an episode ends with: at their full weight from the start."""
PENALTY, COST, LATE = "penalty", "cost", "late"
"""Ramps: penalties grow in over the first iterations, what effort costs further on; rewards for the last few per cent
come when it walks."""


@dataclass(frozen=True, kw_only=True)
class Term:
    """One row of the table."""

    name: str
    equation: str
    weight: float
    value: Callable
    """Of the environment, (n,)."""
    added: str = ""
    """Why it is there, where the paper does not have it; its off-switch is the option of that name set to 0."""
    ramp: str = ""
    spared: bool = False
    """Whether it costs nothing while a push is caught (`recovery_s`)."""

    @property
    def grows(self) -> str:
        """Its ramp: of a penalty that names none theirs, unless an episode ends with it."""
        return self.ramp or (PENALTY if self.weight < 0.0 and self.name not in ENDS else "")
