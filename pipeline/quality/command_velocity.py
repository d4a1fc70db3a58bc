"""Velocity of a motion in the terms of a walking command: forward, left, yaw rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series

STRIDE_S = 1.0
"""Averaging time over which sway and bobbing of a gait cancel: about one stride [s]."""


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
    yaw, velocity = _in_heading_frame(root_pos_w, root_quat_w, fps)
    turned = float(yaw[-1] - yaw[0]) * fps / (len(yaw) - 1)
    return CommandVelocity(
        forward_m_s=float(velocity[:, 0].mean()), lateral_m_s=float(velocity[:, 1].mean()), yaw_rate_rad_s=turned
    )


def command_velocity_over_time(
    root_pos_w: Float[np.ndarray, "t 3"], root_quat_w: Float[np.ndarray, "t 4"], fps: float
) -> Float[np.ndarray, "t 3"]:
    """Forward and lateral velocity [m/s] and yaw rate [rad/s] at each frame, as a mean over `STRIDE_S` about it.

    The velocity is turned into the heading frame first, so that walking on a curve loses nothing. At the ends of the
    motion the window shrinks to the half that is there.
    """
    yaw, velocity = _in_heading_frame(root_pos_w, root_quat_w, fps)
    command = np.concatenate([velocity[:, :2], time_series.derivative(yaw, fps)[:, None]], axis=1)
    return time_series.moving_mean(command, 2 * round(STRIDE_S * fps / 2.0) + 1)


def _in_heading_frame(root_pos_w: np.ndarray, root_quat_w: np.ndarray, fps: float) -> tuple[np.ndarray, np.ndarray]:
    """Heading [rad] (t,), unwrapped, and the root's velocity in its frame [m/s] (t, 3)."""
    yaw = np.unwrap(rotation.yaw_of(root_quat_w))
    return yaw, rotation.rotate_inverse(rotation.about_z(yaw), time_series.derivative(root_pos_w, fps))
