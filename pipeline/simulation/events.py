"""What happens to a robot during a rollout: pushes, kicks, a ball. A figure always names which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force at the centre of mass of the root link for a while."""

    start_s: float
    duration_s: float
    force_w: Float[np.ndarray, " 3"]
    """[N]"""


@dataclass(frozen=True, kw_only=True)
class Kick:
    """A sudden change of the whole robot's velocity."""

    start_s: float
    delta_v_w: Float[np.ndarray, " 3"]
    """[m/s]"""


@dataclass(frozen=True, kw_only=True)
class Throw:
    """A ball against the root link, for plants that have one."""

    start_s: float
    direction_w: Float[np.ndarray, " 3"]
    """Horizontal, unit."""
    speed: float
    """[m/s]"""
    duration_s: float
    """After which the ball is taken away."""


Event = Push | Kick | Throw
