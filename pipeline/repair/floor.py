"""Ground height of a human clip, from the height of the balls of the feet in stance."""

import dataclasses
import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.clips.human_clip import FEET, HumanClip, body
from pipeline.repair.defect import Findings
from pipeline.repair.settings import FloorSettings
from pipeline.repair.tree import FrameMask


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Transform from a piece to its source: `p_source = R_z(heading) p_piece + (x, y, floor + slope t)`."""

    heading_rad: float
    origin_x_m: float
    origin_y_m: float
    floor_m: float
    """Ground height at the piece's first frame [m]."""
    floor_slope_m_s: float = 0.0
    """Vertical velocity of the recording's ground (drift) [m/s]."""

    def origin_w(self, clip: HumanClip) -> np.ndarray:
        """World position of the piece's origin in each frame (t, 1, 3) [m]."""
        place = np.tile([self.origin_x_m, self.origin_y_m, self.floor_m], (clip.frame_count, 1, 1))
        place[:, 0, 2] += self.floor_slope_m_s * np.arange(clip.frame_count) / clip.fps
        return place

    def applied(self, clip: HumanClip) -> HumanClip:
        """Transform a clip from the source's world to the piece's."""
        return _turned(clip, -self.heading_rad, clip.body_pos_w - self.origin_w(clip))

    def undone(self, clip: HumanClip) -> HumanClip:
        """Transform a clip from the piece's world to the source's."""
        turned = _turned(clip, self.heading_rad, clip.body_pos_w)
        return dataclasses.replace(turned, body_pos_w=turned.body_pos_w + self.origin_w(clip))


def _turned(clip: HumanClip, angle: float, pos_w: np.ndarray) -> HumanClip:
    """A clip with bodies at `pos_w` [m], turned about the vertical by an angle [rad]."""
    turn = rotation.about_z(angle)
    quat_w = rotation.make_continuous(rotation.multiply(turn, clip.body_quat_w))
    return dataclasses.replace(clip, body_pos_w=rotation.rotate(turn, pos_w), body_quat_w=quat_w)


def place(clip: HumanClip, floor_m: float, heading_s: float) -> Placement:
    """Placement of a clip: origin at the pelvis, heading from its mean facing over the first `heading_s` [s]."""
    count = max(1, round(heading_s * clip.fps))
    return Placement(
        heading_rad=mean_heading(clip.quat("pelvis")[:count]),
        origin_x_m=float(clip.pos("pelvis")[0, 0]),
        origin_y_m=float(clip.pos("pelvis")[0, 1]),
        floor_m=floor_m,
    )


def mean_heading(quat_w: np.ndarray) -> float:
    """Mean horizontal direction [rad] of the x axes of orientations (t, 4)."""
    ahead = rotation.rotate(quat_w, np.array([1.0, 0.0, 0.0]))[:, :2]
    flat = rotation.normalize(ahead).mean(axis=0)
    return float(np.arctan2(flat[1], flat[0]))


FEWEST_FRAMES = 5
SHORTEST_STANCE_S, LONGEST_STANCE_S = 0.06, 0.6
"""Shorter stances are ignored; longer ones are split into parts [s]."""
LOOKS = 2
"""Number of iterations of the slope estimate."""
FEWEST_STANCES, SHORTEST_WAY_S = 4, 0.5
"""Least number of stances for a slope, and least time between the two stances of a pair [s]."""
FALLBACK_PERCENTILE = 5.0
"""Percentile of the toe heights used as ground where no foot is ever in stance (a clip of a leap)."""

SHAKEN_CODES = ("noise", "bone_length", "spike")
"""Defect codes that shaking is reported with."""
CALM_S, MOST_SHAKEN_M = 0.15, 0.02
"""Averaging time for the position of a shaking toe [s], and largest height scatter for which it is used [m]."""


@dataclass(frozen=True, kw_only=True)
class Floor:
    """Estimated ground; heights in the clip's world [m]."""

    height: float
    """Ground height in the middle of the clip: height of the balls of the feet in stance minus `ball_height`."""
    drift: float
    """Ground height at the clip's end minus that at its beginning; 0 with too few stances."""
    slope_m_s: float
    """Slope that is removed from the clip: the drift per duration where it exceeds `drift_limit`, else 0."""

    def at(self, frame: int, clip: HumanClip) -> float:
        """Ground height at a frame of the recorded clip [m]."""
        return self.height + self.slope_m_s * (frame - (clip.frame_count - 1) / 2.0) / clip.fps


def find_floor(
    clip: HumanClip, settings: FloorSettings, sound: FrameMask, findings: Findings, recorded: HumanClip
) -> Floor:
    """Estimate the ground of a filled clip from its `sound` frames, and from shaking frames of the `recorded` clip.

    The height is the median of the densest band of slow toes' heights (as in PHUMA). The drift is the median slope
    between stances (Theil-Sen estimator), which is robust against single steps onto an object.
    """
    toes = [_toe(clip, side, sound, findings, recorded) for side in FEET]
    slope = 0.0
    for _ in range(LOOKS):  # a known drift improves the choice of slow frames
        slope += _slope([_stances(*toe, slope, clip.fps, settings) for toe in toes], clip.fps, settings)
    taken = slope if abs(slope) * clip.duration_s > settings.drift_limit else 0.0
    level = np.concatenate([_stances(*toe, taken, clip.fps, settings)[1] for toe in toes])
    if len(level) < FEWEST_FRAMES:
        lows = np.concatenate([clip.pos(f"{side}_toe")[sound, 2] for side in FEET])
        lowest = float(np.percentile(lows, FALLBACK_PERCENTILE)) if len(lows) else settings.ball_height
        return Floor(height=lowest - settings.ball_height, drift=0.0, slope_m_s=0.0)
    inside = np.abs(level - densest(level, settings.band)) <= settings.band / 2.0
    return Floor(
        height=float(np.median(level[inside])) - settings.ball_height,
        drift=slope * clip.duration_s,
        slope_m_s=taken,
    )


def levelled(clip: HumanClip, floor: Floor) -> HumanClip:
    """Remove the ground's drift from the clip."""
    if floor.slope_m_s == 0.0:
        return clip
    pos_w = clip.body_pos_w.copy()
    time_s = (np.arange(clip.frame_count) - (clip.frame_count - 1) / 2.0) / clip.fps
    pos_w[..., 2] -= floor.slope_m_s * time_s[:, None]
    return dataclasses.replace(clip, body_pos_w=pos_w)


def _toe(
    clip: HumanClip, side: str, sound: FrameMask, findings: Findings, recorded: HumanClip
) -> tuple[Float[np.ndarray, "t 3"], FrameMask]:
    """Positions of a toe [m], and the frames that are usable for the ground.

    A shaking toe oscillates around its true position, so its mean over `CALM_S` is used. Samples that are lost for
    another reason are not used.
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
    toe_pos_w: Float[np.ndarray, "t 3"], seen: FrameMask, slope_m_s: float, fps: float, settings: FloorSettings
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Frames in which a usable toe is slow, and its heights there [m] with the slope removed."""
    level_w = toe_pos_w.copy()
    level_w[:, 2] -= slope_m_s * (np.arange(len(level_w)) - (len(level_w) - 1) / 2.0) / fps
    speed = np.linalg.norm(time_series.derivative(level_w, fps), axis=1)
    frames = np.flatnonzero((speed < settings.slow_m_s) & seen)
    return frames.astype(float), level_w[frames, 2]


def _slope(stances: list[tuple[np.ndarray, np.ndarray]], fps: float, settings: FloorSettings) -> float:
    """Slope of the ground through the stances [m/s]; 0 with too few stances.

    The Theil-Sen slope (median over pairs, weighted by their time difference) selects the stances on the ground. A line
    through these, weighted by duration, is the more precise estimate. With fewer than two stances within the band of
    their median height (e.g. a foot on a step), the Theil-Sen slope is returned.
    """
    parts = [part for frames, heights in stances for part in _parts(frames, heights, fps)]
    time_s, height, weight = np.array(parts).reshape(-1, 3).T
    first, second = np.triu_indices(len(time_s), 1)
    far = np.abs(time_s[second] - time_s[first]) > SHORTEST_WAY_S
    if len(time_s) < FEWEST_STANCES or not far.any():
        return 0.0
    first, second = first[far], second[far]
    slopes = (height[second] - height[first]) / (time_s[second] - time_s[first])
    slope = time_series.weighted_median(slopes, np.abs(time_s[second] - time_s[first]))
    off = height - slope * time_s
    off -= np.median(off)
    weight = weight * np.clip(1.0 - (off / settings.band) ** 2, 0.0, None) ** 2
    if np.unique(time_s[weight > 0.0]).size < 2:
        return slope
    middle = np.average(time_s, weights=weight)
    return slope + float((weight * off * (time_s - middle)).sum() / (weight * (time_s - middle) ** 2).sum())


def _parts(frames: np.ndarray, heights: np.ndarray, fps: float) -> list[tuple[float, float, float]]:
    """Time [s], height [m] and duration [s] of a foot's stances; long stances are split."""
    result = []
    bounds = [0, *(np.flatnonzero(np.diff(frames) > 1) + 1).tolist(), len(frames)]
    for low, high in itertools.pairwise(bounds):
        parts = max(1, int((high - low) / (fps * LONGEST_STANCE_S)))
        for part in range(parts):
            start, stop = (low + (high - low) * edge // parts for edge in (part, part + 1))
            if stop - start >= SHORTEST_STANCE_S * fps:
                when, middle = (frames[start] + frames[stop - 1]) / 2.0 / fps, (stop - start) // 2
                result.append((float(when), float(np.sort(heights[start:stop])[middle]), (stop - start) / fps))
    return result


def densest(values: Float[np.ndarray, " n"], width: float) -> float:
    """Centre of the interval of `width` that contains most of `values`; in a tie the lowest, then the narrowest."""
    ordered = np.sort(values)
    last = np.searchsorted(ordered, ordered + width, side="right")
    count = last - np.arange(len(ordered))
    spread = ordered[last - 1] - ordered
    best = int(np.lexsort((spread, ordered, -count))[0])
    return float(ordered[best] + ordered[last[best] - 1]) / 2.0
