"""Flight phases and how fast a body falls in them, in frames.

A foot that stands is still in the world, whatever the floor looks like and whatever the rate is. Where neither
foot is, the body is thrown: it follows a parabola whose curvature in metres per frame² tells how long a frame is,
because gravity is known. The trunk stands for the body: over right recordings of four sources its fall is 7.4 to
10.8 m/s², that of a centre of mass from joint positions scatters more.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import minimum_filter1d

from pipeline import time_series
from pipeline.catalog.gait import Legs
from pipeline.clips.human_clip import FEET, HumanClip

STILL_SHARE = 0.25
"""A foot of which ankle or ball moves slower than this share of the body's speed stands, or is about to."""
CLEARANCE = 0.01
"""Both feet are over their lowest point of a stride by this share of the leg's length."""
SHORTEST_FRAMES = 4
"""Fewer frames tell no curvature."""


@dataclass(frozen=True, kw_only=True)
class Flights:
    """Flight phases [start, stop) of a clip."""

    phases: tuple[tuple[int, int], ...]
    fall: Float[np.ndarray, " n"]
    """Downward acceleration of the trunk in each [m/frame²]."""

    @property
    def frames(self) -> Float[np.ndarray, " n"]:
        """Duration of each [frames]."""
        return np.array([stop - start for start, stop in self.phases], dtype=float)


@dataclass(frozen=True, kw_only=True)
class Person(Legs):
    """A person's clip as both clocks look at it."""

    @functools.cached_property
    def flights(self) -> Flights:
        """The flight phases of running and jumping."""
        return find_flights(self)


def find_flights(legs: Legs) -> Flights:
    """The flight phases of running and jumping; none where no steps are seen or positions are missing."""
    clip, step_rate = legs.clip, legs.step_rate
    if step_rate is None:
        return Flights(phases=(), fall=np.zeros(0))
    height = 0.5 * (clip.pos("pelvis") + clip.pos("chest"))[:, 2]
    airborne = _airborne(clip, 2 * int(2.0 / step_rate / 2.0) + 1, legs.leg_length) & np.isfinite(height)
    phases = tuple(
        (start, stop)
        for start, stop in time_series.runs(airborne)
        if stop - start >= SHORTEST_FRAMES and start > 0 and stop < clip.frame_count
    )
    return Flights(phases=phases, fall=np.array([_fall(height[start:stop]) for start, stop in phases]))


def _airborne(clip: HumanClip, stride: int, leg: float) -> Bool[np.ndarray, " t"]:
    """Frames (t,) in which no foot stands, while the body travels at least a leg's length in a stride."""
    points = np.stack([clip.pos(f"{side}_{part}") for side in FEET for part in ("ankle", "toe")], axis=1)
    slowest = np.linalg.norm(time_series.derivative(points, 1.0), axis=2).min(axis=1)
    travel = time_series.derivative(_filled_mean(clip.pos("pelvis")[:, :2], stride), 1.0)
    body_speed = np.linalg.norm(travel, axis=1)
    heights = points[:, :, 2].copy()
    heights[:, 0::2] -= np.nanpercentile(heights[:, 0::2], 5.0) - np.nanpercentile(heights[:, 1::2], 5.0)
    lowest = heights.min(axis=1)
    lowest = np.where(np.isfinite(lowest), lowest, np.nanmin(lowest))
    clear = lowest - minimum_filter1d(lowest, stride) > CLEARANCE * leg
    return clear & (slowest > STILL_SHARE * body_speed) & (body_speed * stride > leg)


def _filled_mean(values: np.ndarray, width: int) -> np.ndarray:
    """Moving mean (t, 2) of positions; missing ones keep the last known place."""
    known = np.isfinite(values).all(axis=1)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
    return time_series.moving_mean(np.nan_to_num(values)[last], width)


def _fall(height: Float[np.ndarray, " n"]) -> float:
    """Downward acceleration [m/frame²] of the least-squares parabola."""
    frames = np.arange(len(height)) - (len(height) - 1) / 2.0
    return float(-2.0 * np.polyfit(frames, height, 2)[0])
