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


FADE_S = 0.1
"""Time over which the correcting velocity fades to zero beside the stretch that slides [s]."""


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
    is interpolated. Outside `within` the velocity that is taken off fades to zero; frames beyond move along.
    """
    slide = _slide(feet, contacts)
    smooth = gaussian_filter1d(slide[within], SMOOTH_S * clip.fps, axis=0, mode="nearest")
    every = np.arange(len(slide))
    first, last = every[within][[0, -1]]
    nearest = np.clip(every, first, last)
    correction = _fading(np.abs(every - nearest) / clip.fps)[:, None] * smooth[nearest - first]
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


def _fading(away_s: Float[np.ndarray, " t"]) -> Float[np.ndarray, " t"]:
    """1 at no distance in time, 0 from `FADE_S` on, without a step in value or slope."""
    share = np.clip(away_s / FADE_S, 0.0, 1.0)
    return 1.0 - share**2 * (3.0 - 2.0 * share)


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
