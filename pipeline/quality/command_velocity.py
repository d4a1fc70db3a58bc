"""How a motion moves in the terms a walking command has: forward, to the left, turning left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series


@dataclass(frozen=True, kw_only=True)
class CommandVelocity:
    """Means over a motion."""

    forward_m_s: float
    lateral_m_s: float
    """To the left."""
    yaw_rate_rad_s: float
    """To the left (counter-clockwise from above)."""


def command_velocity(
    root_pos_w: Float[np.ndarray, "t 3"], root_quat_w: Float[np.ndarray, "t 4"], fps: float
) -> CommandVelocity:
    """Mean velocity of the root in its own heading frame at each time, and mean yaw rate.

    The heading is the twist of the root about the vertical, so that tilting doesn't turn it.
    """
    if len(root_pos_w) < 2:
        return CommandVelocity(forward_m_s=0.0, lateral_m_s=0.0, yaw_rate_rad_s=0.0)
    yaw = np.unwrap(rotation.yaw_of(root_quat_w))
    velocity = rotation.rotate_inverse(rotation.about_z(yaw), time_series.derivative(root_pos_w, fps))
    turned = float(yaw[-1] - yaw[0]) * fps / (len(yaw) - 1)
    return CommandVelocity(
        forward_m_s=float(velocity[:, 0].mean()), lateral_m_s=float(velocity[:, 1].mean()), yaw_rate_rad_s=turned
    )
