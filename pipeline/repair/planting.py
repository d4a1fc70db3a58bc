"""Feet that slide slowly while they stand are planted: the whole body is moved against the slide.

A skeleton whose legs are longer or shorter than its person's makes standing feet slide in step with the walk, by 0.10
to 0.15 m/s in much of CMU's data. All joint angles are right there; only the body's way over the ground is not.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from pipeline.clips.human_clip import HumanClip
from pipeline.repair.contacts import FootPoints

SMOOTH_S = 0.05
"""The correcting velocity is smoothed over this time, so that the body takes no step [s]."""


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A clip with its feet planted."""

    clip: HumanClip
    mean_m_s: float
    """Mean speed that was taken from the body [m/s]."""
    way_m: float
    """How far the body is moved over the clip [m]."""


def planted(
    clip: HumanClip,
    feet: tuple[FootPoints, FootPoints],
    contacts: Bool[np.ndarray, "t 2"],
    within: slice,
    highest_m_s: float,
) -> Planted:
    """The clip moved over the ground so that feet in contact stand, by `highest_m_s` at most at any time.

    Of a standing foot the slower of ball and heel is planted; of two standing feet their mean. In flight the velocity
    is interpolated. Frames outside `within` move along with its ends.
    """
    slide = _slide(feet, contacts)
    correction = np.zeros_like(slide)
    correction[within] = gaussian_filter1d(slide[within], SMOOTH_S * clip.fps, axis=0, mode="nearest")
    speed = np.linalg.norm(correction, axis=1, keepdims=True)
    correction *= np.minimum(1.0, highest_m_s / np.maximum(speed, 1e-9))
    step = (correction[1:] + correction[:-1]) / 2.0 / clip.fps
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    pos_w = clip.body_pos_w.copy()
    pos_w[..., :2] -= way[:, None]
    return Planted(
        clip=dataclasses.replace(clip, body_pos_w=pos_w),
        mean_m_s=float(np.minimum(speed, highest_m_s)[within].mean()),
        way_m=float(np.linalg.norm(way[within][-1] - way[within][0])),
    )


def _slide(feet: tuple[FootPoints, FootPoints], contacts: Bool[np.ndarray, "t 2"]) -> Float[np.ndarray, "t 2"]:
    """Velocity [m/s] along the ground of what stands, interpolated over frames in which nothing does."""
    velocities = []
    for foot in feet:
        slower = foot.horizontal.argmin(axis=1)
        velocities.append(np.take_along_axis(foot.along_ground, slower[:, None, None], axis=1)[:, 0])
    count = contacts.sum(axis=1)
    stands = np.flatnonzero(count)
    if not len(stands):
        return np.zeros((len(contacts), 2))
    total = sum(velocity * contacts[:, [side]] for side, velocity in enumerate(velocities))
    known = np.asarray(total)[stands] / count[stands, None]
    every = np.arange(len(contacts))
    return np.stack([np.interp(every, stands, known[:, axis]) for axis in range(2)], axis=1)
