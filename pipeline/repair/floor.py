"""The height of the ground under a person: where the balls of the feet are when they stand."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.clips.human_clip import FEET, HumanClip, body
from pipeline.repair.defect import Findings
from pipeline.repair.settings import FloorSettings

FEWEST_FRAMES = 5
SHORTEST_STANCE_S, LONGEST_STANCE_S = 0.06, 0.5
"""Shorter stances are none; longer ones are looked at in parts [s]."""
FEWEST_STANCES, SHORTEST_WAY_S = 4, 0.5
"""So many stances tell a slope, by those that are so far apart [s]."""
FALLBACK_PERCENTILE = 5.0
"""Where no foot ever stands (a clip of a leap) the ground is taken from the lowest toes."""

SHAKEN_CODES = ("noise", "bone_length", "spike")
"""What shaking is told as."""
CALM_S, MOST_SHAKEN_M = 0.15, 0.02
"""A toe that shakes is where its mean over this time is [s], unless its height scatters by more [m]."""


@dataclass(frozen=True, kw_only=True)
class Floor:
    """What is known of the ground; heights in the clip's world [m]."""

    height: float
    """The ground in the middle of the clip: where the balls of the feet stand less their height over it."""
    drift: float
    """How much higher the ground is at the clip's end than at its beginning; 0 where too few stances tell."""
    slope_m_s: float
    """What is taken out of the clip: the drift over its duration where it is more than people's feet explain, or 0."""
    stance_frames: int
    """Foot-frames the height was taken from."""

    def at(self, frame: int, clip: HumanClip) -> float:
        """Height of the ground at a frame of the clip as it was recorded [m]."""
        return self.height + self.slope_m_s * (frame - (clip.frame_count - 1) / 2.0) / clip.fps


def find_floor(
    clip: HumanClip, settings: FloorSettings, sound: Bool[np.ndarray, " t"], findings: Findings, recorded: HumanClip
) -> Floor:
    """The ground of a clip, as filled, from its `sound` frames; and from those that shake, as `recorded`.

    Of the heights of slow toes the densest band is taken (as PHUMA does) and its median. A drift is the median slope
    between stances (Theil and Sen), which single steps onto something do not change.
    """
    toes = [_toe(clip, side, sound, findings, recorded) for side in FEET]
    stances = [_stances(pos_w, seen, clip.fps, settings) for pos_w, seen in toes]
    when = np.concatenate([frames for frames, _ in stances])
    height = np.concatenate([heights for _, heights in stances])
    if len(height) < FEWEST_FRAMES:
        toes = np.concatenate([clip.pos(f"{side}_toe")[sound, 2] for side in FEET])
        lowest = float(np.percentile(toes, FALLBACK_PERCENTILE)) if len(toes) else settings.ball_height
        return Floor(height=lowest - settings.ball_height, drift=0.0, slope_m_s=0.0, stance_frames=0)
    middle = (clip.frame_count - 1) / 2.0
    slope = _slope(stances, clip.fps, settings)
    drifts = abs(slope) * clip.duration_s > settings.drift_limit
    level = height - slope * (when - middle) / clip.fps if drifts else height
    inside = np.abs(level - densest(level, settings.band)) <= settings.band / 2.0
    return Floor(
        height=float(np.median(level[inside])) - settings.ball_height,
        drift=slope * clip.duration_s,
        slope_m_s=slope if drifts else 0.0,
        stance_frames=int(inside.sum()),
    )


def levelled(clip: HumanClip, floor: Floor) -> HumanClip:
    """The clip without the drift of its ground."""
    if floor.slope_m_s == 0.0:
        return clip
    pos_w = clip.body_pos_w.copy()
    time_s = (np.arange(clip.frame_count) - (clip.frame_count - 1) / 2.0) / clip.fps
    pos_w[..., 2] -= floor.slope_m_s * time_s[:, None]
    return dataclasses.replace(clip, body_pos_w=pos_w)


def _toe(
    clip: HumanClip, side: str, sound: Bool[np.ndarray, " t"], findings: Findings, recorded: HumanClip
) -> tuple[Float[np.ndarray, "t 3"], Bool[np.ndarray, " t"]]:
    """Positions of a toe [m], and the frames that tell of the ground.

    A toe that shakes does so about where it is: what is too rough for motion still tells a height, by its mean over a
    while. Only what is lost for another reason is not used.
    """
    index = body(f"{side}_toe")
    pos_w, seen, raw = clip.body_pos_w[:, index].copy(), sound.copy(), recorded.body_pos_w[:, index]
    shaken, lost = np.zeros_like(sound), np.asarray(~np.isfinite(raw).all(axis=1))
    for one in findings.defects:
        if one.code == "noise":
            shaken[one.start : one.stop] = True
        elif one.code not in SHAKEN_CODES and index in one.bodies:
            lost[one.start : one.stop] = True
    width = 2 * round(CALM_S * clip.fps / 2.0) + 1
    for start, stop in time_series.runs(shaken & ~lost & ~sound):
        calm = time_series.moving_mean(raw[start:stop], width)
        if stop - start >= width and float(np.std(raw[start:stop, 2] - calm[:, 2])) < MOST_SHAKEN_M:
            pos_w[start:stop], seen[start:stop] = calm, True
    return pos_w, seen


def _stances(
    toe_pos_w: Float[np.ndarray, "t 3"], seen: Bool[np.ndarray, " t"], fps: float, settings: FloorSettings
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Frames in which a toe is slow, of those in which it is seen, and its heights there [m]."""
    speed = np.linalg.norm(time_series.derivative(toe_pos_w, fps), axis=1)
    frames = np.flatnonzero((speed < settings.slow_m_s) & seen)
    return frames.astype(float), toe_pos_w[frames, 2]


def _slope(stances: list[tuple[np.ndarray, np.ndarray]], fps: float, settings: FloorSettings) -> float:
    """Median slope of the ground between stances [m/s], each weighed by its time apart; 0 where too few are told."""
    time_s, height = [], []
    for frames, heights in stances:
        bounds = [0, *(np.flatnonzero(np.diff(frames) > 1) + 1).tolist(), len(frames)]
        for low, high in itertools.pairwise(bounds):
            parts = max(1, round((high - low) / (fps * LONGEST_STANCE_S)))
            for part in range(parts):
                start, stop = (low + (high - low) * edge // parts for edge in (part, part + 1))
                if stop - start >= SHORTEST_STANCE_S * fps:
                    time_s.append((frames[start] + frames[stop - 1]) / 2.0 / fps)
                    height.append(np.sort(heights[start:stop])[(stop - start) // 2])
    first, second = np.triu_indices(len(time_s), 1)
    apart = np.abs(np.array(time_s)[second] - np.array(time_s)[first]) if len(first) else np.zeros(0)
    far = apart > SHORTEST_WAY_S
    if len(time_s) < FEWEST_STANCES or not far.any():
        return 0.0
    first, second, apart = first[far], second[far], apart[far]
    slopes = (np.array(height)[second] - np.array(height)[first]) / (np.array(time_s)[second] - np.array(time_s)[first])
    order = np.argsort(slopes, kind="stable")
    total = np.cumsum(apart[order])
    return float(slopes[order][np.searchsorted(total, total[-1] / 2.0)])


def densest(values: Float[np.ndarray, " n"], width: float) -> float:
    """Centre of the interval of `width` that holds the most of `values`; of equals the lowest, then the tightest."""
    ordered = np.sort(values)
    last = np.searchsorted(ordered, ordered + width, side="right")
    count = last - np.arange(len(ordered))
    spread = ordered[last - 1] - ordered
    best = int(np.lexsort((spread, ordered, -count))[0])
    return float(ordered[best] + ordered[last[best] - 1]) / 2.0
