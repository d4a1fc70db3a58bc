"""Foot contacts and foot slip.

A foot has two contact points: the ball (toe joint) and the heel, which is behind and below the ankle in the foot's
frame. Each has its own stance height, estimated from the clip's slow frames. A foot is in contact while one of its
points is low and slow.
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
"""Distance of the heel behind the ankle [m]: a fifth of the foot's 0.26 m (Winter 2009, foot length 0.152 H)."""
HEIGHT_BAND = 0.03
"""Width of the height band for the estimate of a point's stance height [m]."""
SLOW_M_S = 0.25
"""Speed below which a point may be in stance [m/s]."""
USUAL_PERCENTILE, TIMES_USUAL = 75.0, 2.0
"""A contact begins below `TIMES_USUAL` times this percentile of the planted points' speed."""


@dataclass(frozen=True, kw_only=True)
class FootPoints:
    """Ball and heel of one foot, t frames."""

    height: Float[np.ndarray, "t 2"]
    """Height of ball and heel above their own stance height [m]."""
    speed: Float[np.ndarray, "t 2"]
    """Speed of ball and heel in the world [m/s]."""
    along_ground: Float[np.ndarray, "t 2 2"]
    """World x and y velocity of ball and heel [m/s]."""

    @property
    def horizontal(self) -> Float[np.ndarray, "t 2"]:
        """Horizontal speed of ball and heel [m/s]."""
        return np.linalg.norm(self.along_ground, axis=-1)

    def cut(self, part: slice) -> "FootPoints":
        """The frames of `part`."""
        return FootPoints(height=self.height[part], speed=self.speed[part], along_ground=self.along_ground[part])


Feet = tuple[FootPoints, FootPoints]
"""Contact points of the left and the right foot."""
Contacts = Bool[np.ndarray, "t 2"]
"""Foot on the ground (left, right)."""


def foot_points(clip: HumanClip, side: str, ground: float) -> FootPoints:
    """Ball and heel of a foot; `ground` is the clip's floor [m], which bounds the stance heights."""
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

    The speed limit adapts to the clip: in a clean recording feet hardly move in stance, in a noisy one they always
    move. The settings are upper bounds.
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
    """Speed limit [m/s] below which a low point of this clip begins a contact."""
    planted = []
    for foot in feet:
        low_speed = np.where(foot.height < settings.height, foot.speed, np.inf).min(axis=1)
        planted.append(low_speed[low_speed < settings.speed_on_m_s])
    speed = np.concatenate(planted)
    usual = float(np.percentile(speed, USUAL_PERCENTILE)) if len(speed) else settings.speed_on_m_s
    return float(np.clip(TIMES_USUAL * usual, settings.speed_floor_m_s, settings.speed_on_m_s))


def stance_slip(feet: Feet, contacts: Contacts) -> float:
    """Mean speed [m/s] of the slower of ball and heel of feet in contact, without the ends of each stance."""
    inner = inner_contacts(contacts)
    speed = np.concatenate([foot.horizontal.min(axis=1)[inner[:, side]] for side, foot in enumerate(feet)])
    return float(speed.mean()) if len(speed) else 0.0


def both_feet(clip: HumanClip, ground: float) -> Feet:
    """Contact points of both feet; `ground` is the clip's floor [m]."""
    left, right = (foot_points(clip, side, ground) for side in FEET)
    return left, right


def _stance_height(point_w: Float[np.ndarray, "t 3"], fps: float, ground: float) -> float:
    """Median height of a point in the densest height band of its slow frames [m]; without such frames its 5th
    percentile."""
    speed = np.linalg.norm(time_series.derivative(point_w, fps), axis=1)
    height = point_w[speed < SLOW_M_S, 2]
    height = height[height < ground + 0.25]
    if len(height) < 3:
        return float(np.percentile(point_w[:, 2], 5.0))
    centre = densest(height, HEIGHT_BAND)
    return float(np.median(height[np.abs(height - centre) <= HEIGHT_BAND / 2.0]))


def _grown(sure: FrameMask, possible: FrameMask) -> FrameMask:
    """Runs of `possible` that contain a frame of `sure`: hysteresis in both time directions."""
    result = np.zeros_like(sure)
    for start, stop in time_series.runs(possible):
        result[start:stop] = sure[start:stop].any()
    return result
