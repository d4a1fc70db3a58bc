"""Which foot is on the ground, and whether it stays where it stands.

A foot has two points that it stands on: the ball (toe joint) and the heel, which lies behind and below
the ankle in the foot's frame. Each has its own stance height, taken from the clip's slow frames. A foot is on the
ground while one of them is low and slow.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip
from pipeline.quality.sole import inner_contacts
from pipeline.repair.floor import densest
from pipeline.repair.settings import ContactSettings
from pipeline.repair.tree import FrameMask

HEEL_BACK = 0.05
"""Heel behind the ankle [m]: the ankle lies over a quarter of the foot's .26 m (Winter 2009, foot length .152 H)."""
HEIGHT_BAND = 0.03
"""Width of the band of heights in which a point's stance height is sought [m]."""
SLOW_M_S = 0.25
"""A point slower than this may stand [m/s]."""
USUAL_PERCENTILE, TIMES_USUAL = 75.0, 2.0
"""A contact begins below twice the speed that three quarters of the planted points stay below."""


@dataclass(frozen=True, kw_only=True)
class FootPoints:
    """Ball and heel of one foot over T frames."""

    height: Float[np.ndarray, "t 2"]
    """Over each point's own stance height [m]: ball, heel."""
    speed: Float[np.ndarray, "t 2"]
    """In the world [m/s]."""
    along_ground: Float[np.ndarray, "t 2 2"]
    """Velocity in the world's x and y [m/s]."""

    @property
    def horizontal(self) -> Float[np.ndarray, "t 2"]:
        """Speed along the ground [m/s]."""
        return np.linalg.norm(self.along_ground, axis=-1)

    def cut(self, part: slice) -> "FootPoints":
        """The frames of `part`."""
        return FootPoints(height=self.height[part], speed=self.speed[part], along_ground=self.along_ground[part])


Feet = tuple[FootPoints, FootPoints]
"""Left and right."""
Contacts = Bool[np.ndarray, "t 2"]
"""Foot on the ground (left, right)."""


def foot_points(clip: HumanClip, side: str, ground: float) -> FootPoints:
    """Ball and heel of a foot; `ground` is the clip's floor [m], which no stance height strays far from."""
    ball_w, ankle_w, foot_quat = clip.pos(f"{side}_toe"), clip.pos(f"{side}_ankle"), clip.quat(f"{side}_ankle")
    ankle_height = _stance_height(ankle_w, clip.fps, ground)
    heel_w = ankle_w + rotation.rotate(foot_quat, np.array([-HEEL_BACK, 0.0, -(ankle_height - ground)]))
    points = np.stack([ball_w, heel_w], axis=1)
    stance = np.array([_stance_height(point_w, clip.fps, ground) for point_w in (ball_w, heel_w)])
    velocity = time_series.derivative(points, clip.fps)
    speed = np.linalg.norm(velocity, axis=-1)
    return FootPoints(height=points[..., 2] - stance, speed=speed, along_ground=velocity[..., :2])


def label_contacts(feet: Feet, fps: float, settings: ContactSettings) -> Contacts:
    """Foot on the ground (left, right).

    How slow is slow follows from the clip: feet of a clean recording hardly move in stance, and what does is on
    its way; in a noisy one everything moves. The settings are the upper bounds.
    """
    shortest = max(1, round(settings.shortest_s * fps))
    on_m_s = _slow(feet, settings)
    off_m_s = on_m_s * settings.speed_off_m_s / settings.speed_on_m_s
    columns = []
    for foot in feet:
        low = foot.height < settings.height
        sure = np.any(low & (foot.speed < on_m_s), axis=1)
        possible = np.any(low & (foot.speed < off_m_s), axis=1)
        columns.append(time_series.without_short_runs(_grown(sure, possible), shortest))
    return np.stack(columns, axis=-1)


def _slow(feet: Feet, settings: ContactSettings) -> float:
    """Speed [m/s] below which a low point of this clip begins a contact."""
    planted = []
    for foot in feet:
        low_speed = np.where(foot.height < settings.height, foot.speed, np.inf).min(axis=1)
        planted.append(low_speed[low_speed < settings.speed_on_m_s])
    speed = np.concatenate(planted)
    usual = float(np.percentile(speed, USUAL_PERCENTILE)) if len(speed) else settings.speed_on_m_s
    return float(np.clip(TIMES_USUAL * usual, settings.speed_floor_m_s, settings.speed_on_m_s))


def stance_slip(feet: Feet, contacts: Contacts) -> float:
    """Mean horizontal speed [m/s] of the slower of ball and heel of standing feet, without the ends of each stance."""
    inner = inner_contacts(contacts)
    speed = np.concatenate([foot.horizontal.min(axis=1)[inner[:, side]] for side, foot in enumerate(feet)])
    return float(speed.mean()) if len(speed) else 0.0


def both_feet(clip: HumanClip, ground: float) -> Feet:
    """The points of the left and the right foot."""
    left, right = (foot_points(clip, side, ground) for side in FEET)
    return left, right


def _stance_height(point_w: Float[np.ndarray, "t 3"], fps: float, ground: float) -> float:
    """Median height of a point in the densest band of its slow frames [m]; else its lowest twentieth."""
    speed = np.linalg.norm(time_series.derivative(point_w, fps), axis=1)
    height = point_w[speed < SLOW_M_S, 2]
    height = height[height < ground + 0.25]
    if len(height) < 3:
        return float(np.percentile(point_w[:, 2], 5.0))
    centre = densest(height, HEIGHT_BAND)
    return float(np.median(height[np.abs(height - centre) <= HEIGHT_BAND / 2.0]))


def _grown(sure: FrameMask, possible: FrameMask) -> FrameMask:
    """Runs of `possible` that hold a frame of `sure`: hysteresis in both directions of time."""
    result = np.zeros_like(sure)
    for start, stop in time_series.runs(possible):
        result[start:stop] = sure[start:stop].any()
    return result
