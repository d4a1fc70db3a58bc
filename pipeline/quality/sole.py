"""Positions and velocities of the sole corners of a robot motion.

The literature defines foot slip by the speed of the ankle, of the sole's centre or of a corner. Here it is the
horizontal speed of the sole's lowest corner while the foot is in contact, which is 0 for a foot that rolls over heel
and toe.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.clips.robot_clip import RobotClip
from pipeline.files.ranges import Range, check, increasing
from pipeline.files.sourced import Unit
from pipeline.robot import Kinematics, Robot


@dataclass(frozen=True, kw_only=True)
class SoleMotion:
    """Corners of the left and right sole over T frames."""

    fps: float
    corner_pos_w: Float[np.ndarray, "t 2 4 3"]
    """[m]"""
    corner_vel_w: Float[np.ndarray, "t 2 4 3"]
    """[m/s], central differences."""

    @property
    def height(self) -> Float[np.ndarray, "t 2"]:
        """Height of the lowest corner over the ground [m]; negative below it."""
        return self.corner_pos_w[..., 2].min(axis=2)

    @property
    def lowest_corner_speed(self) -> Float[np.ndarray, "t 2"]:
        """Horizontal speed of the lowest corner [m/s]."""
        lowest = self.corner_pos_w[..., 2].argmin(axis=2)[..., None, None]
        velocity = np.take_along_axis(self.corner_vel_w, np.broadcast_to(lowest, (*lowest.shape[:3], 3)), axis=2)
        return np.linalg.norm(velocity[:, :, 0, :2], axis=-1)

    @property
    def mean_speed(self) -> Float[np.ndarray, "t 2"]:
        """Speed of the sole's centre [m/s], vertical part included."""
        return np.linalg.norm(self.corner_vel_w.mean(axis=2), axis=-1)


def sole_motion(clip: RobotClip, robot: Robot) -> SoleMotion:
    """The soles of a clip at the clip's own rate."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    names = [name for side in robot.sole_corners for name in side]
    corners = kinematics.site_pos_w(poses, names).reshape(-1, 2, 4, 3)
    return SoleMotion(fps=clip.fps, corner_pos_w=corners, corner_vel_w=time_series.derivative(corners, clip.fps))


def lowest_corner_slip(sole: SoleMotion, contacts: Bool[np.ndarray, "t 2"]) -> tuple[float, float]:
    """Horizontal speed of the lowest corner of feet in contact, mean and 95th percentile [m/s]; 0 without contact."""
    speed = sole.lowest_corner_speed[inner_contacts(contacts)]
    return (float(speed.mean()), float(np.percentile(speed, 95))) if speed.size else (0.0, 0.0)


def inner_contacts(contacts: Bool[np.ndarray, "t 2"]) -> Bool[np.ndarray, "t 2"]:
    """Contacts without the first and last frame of each, where central differences include the swing."""
    inner = contacts.copy()
    inner[1:] &= contacts[:-1]
    inner[:-1] &= contacts[1:]
    return inner


_SPEED = Range(0.0, 5.0, open_low=True)


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """A foot is in contact if its sole is low and slow: the section `contact` of `data/feasibility.yaml`, and of
    `data/augment.yaml`."""

    height: Annotated[float, Range(0.0, 0.2, open_low=True), Unit("m")]
    """Largest height of the lowest corner [m]."""
    on_speed: Annotated[float, _SPEED, Unit("m/s")]
    """Speed of the sole below which a contact begins [m/s]."""
    off_speed: Annotated[float, _SPEED, Unit("m/s")]
    """Speed of the sole above which a contact ends [m/s]."""
    shortest_s: Annotated[float, Range(0.0, 1.0), Unit("s")]
    """Contacts and gaps shorter than this are ignored [s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "on_speed", "off_speed"))


def contact_from_sole(sole: SoleMotion, settings: ContactSettings) -> Bool[np.ndarray, "t 2"]:
    """Contact of the left and right foot: low and slow, with hysteresis.

    Gaps shorter than `settings.shortest_s` are closed first, then short contacts are removed.
    """
    low, speed = sole.height < settings.height, sole.mean_speed
    begins, lasts = low & (speed < settings.on_speed), low & (speed < settings.off_speed)
    frames = np.arange(len(low))[:, None]
    begun = np.maximum.accumulate(np.where(begins, frames, -1), axis=0)
    ended = np.maximum.accumulate(np.where(lasts, -1, frames), axis=0)
    contact = begun > ended
    shortest = round(settings.shortest_s * sole.fps)
    return np.stack([time_series.without_short_runs(side, shortest) for side in contact.T], axis=1)
