"""Detect foot skating (a supporting foot that slides over the ground), and plant slowly sliding feet.

In walking, some point of the feet is always planted; in running, for most of a stride. The slowest point near the
ground is therefore at rest repeatedly. If it is not for most of a second, the feet slide.

The start and end of a slide also show in the whole body: all joints gain the slide's velocity in a single step, which
no person can do. Where such a velocity step exists, it is the edge; otherwise the edge is where the feet's evidence
changes sign.

Slowly sliding feet are planted by moving the whole body against the slide. If the legs of the skeleton are longer or
shorter than the person's, feet in stance slide periodically, by 0.10 to 0.15 m/s in many CMU clips. The joint angles
are correct there; only the body's path over the ground is wrong.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from pipeline import time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.repair.contacts import Contacts, Feet
from pipeline.repair.settings import ContactSettings
from pipeline.repair.tree import Positions

WINDOW_S, STILL_PERCENTILE = 0.8, 20.0
"""Window length [s] and percentile of the speed in it that shows whether a foot is in stance."""
REACH_S = 0.8
"""Search range for an edge around the start and the end of such windows [s]."""
REST_S = 0.2
"""A remainder at the clip's ends shorter than this (a stance) is added to the slide [s]."""
SWINGING = 2.0
"""Speed relative to the slowest fifth above which a point swings."""
TELLING = 1.5
"""Speed relative to the sliding feet above which a point is evidence for neither stance nor sliding."""
STEADY = 0.5
"""Change of speed per frame, relative to the sliding speed, above which a point is not sliding."""
LOOKS, STRAIGHT = 4, 0.7
"""Iterations for the slide's velocity, and ratio of mean velocity to mean speed from which it has a direction."""
NEAR = 0.5
"""Largest deviation of a point that matches, from zero (stance) or the slide's velocity, as a share of that."""
KICK_S = 0.4
"""Search range for a velocity step of the body around the edge given by the feet [s]."""
KICK_OFF, KICK_SPREAD, MOST_BODIES = 0.75, 0.6, 75.0
"""Limits of a velocity step, as shares: its deviation from the slide's velocity, the deviation of the bodies' steps
from it, and the percentile of the bodies that must satisfy this."""
KEPT_S = 0.05
"""Time for which the pelvis must keep the velocity step [s]; otherwise it is a spike."""
FAST = 9.0
"""Speed that represents a frame without a point near the ground [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Skating:
    """Frames [start, stop) in which the feet slide."""

    start: int
    stop: int
    speed_m_s: float


def find_skating(feet: Feet, pos_w: Positions, fps: float, settings: ContactSettings) -> list[Skating]:
    """Stretches of a clip in which feet are on the ground but none is at rest.

    `feet` may be low-passed; `pos_w` are the recorded body positions [m], in which a slide starts within one frame.
    """
    speed = support_speed(feet, fps, settings)
    width = min(2 * round(WINDOW_S * fps / 2.0) + 1, len(speed))
    usual = _slowest_fifth(speed, width)
    core = (usual > settings.skate_limit_m_s) & (usual < FAST)
    if not core.any():
        return []
    result: list[Skating] = []
    velocity = _near_ground(feet, fps, settings)
    reach, rest = round(REACH_S * fps), round(REST_S * fps)
    for start, stop in time_series.runs(core):
        inside = speed[start:stop]
        grounded = inside[inside < FAST]
        if not len(grounded):
            continue  # in the air nothing slides; the length of flight phases is checked elsewhere
        fifth = float(usual[start:stop].max())
        sliding = float(np.clip(np.median(grounded), fifth, SWINGING * fifth))
        glide = _glide(velocity, slice(start, stop), sliding)
        evidence = _evidence_of(speed, sliding) if glide is None else _evidence_by_way(velocity, glide)
        middle = (start + stop) // 2
        low, high = max(start - reach, 0), min(stop + reach, len(speed))
        before = _most_evidence(evidence[low : middle + 1][::-1])
        after = _most_evidence(evidence[middle:high])
        low, high = middle + 1 - before, middle + after
        low, high = 0 if low < rest else low, len(speed) if len(speed) - high < rest else high
        if glide is not None:
            low, high = _kicked(pos_w, glide, (low, high), fps)
        if result and low < result[-1].stop:
            low = result[-1].start
            result.pop()
        result.append(Skating(start=low, stop=high, speed_m_s=sliding))
    return result


def _slowest_fifth(speed: Float[np.ndarray, " t"], width: int) -> Float[np.ndarray, " t"]:
    """The `STILL_PERCENTILE` of the frames of a window in which a point is near the ground; `FAST` where none is.

    Frames in the air are not counted: in a fast run at 30 Hz the foot is at rest in only two or three frames of a
    stride. At the clip's ends the window repeats the last frame.
    """
    half = width // 2
    windows = np.sort(sliding_window_view(np.pad(speed, (half, width - 1 - half), mode="edge"), width), axis=1)
    rank = ((windows < FAST).sum(axis=1) * STILL_PERCENTILE / 100.0).astype(int)
    return np.take_along_axis(windows, rank[:, None], axis=1)[:, 0]


def support_speed(feet: Feet, fps: float, settings: ContactSettings) -> Float[np.ndarray, " t"]:
    """Horizontal speed of the slowest point near the ground [m/s]; `FAST` where there is none."""
    horizontal = np.concatenate([foot.horizontal for foot in feet], axis=1)
    return np.where(_height(feet, fps) < settings.height, np.minimum(horizontal, FAST), FAST).min(axis=1)


def _height(feet: Feet, fps: float) -> Float[np.ndarray, "t 4"]:
    """Height of balls and heels above the local ground, the lowest point around each frame [m].

    A clip whose feet always slide has no stance heights, so the ground is estimated from the lowest points.
    """
    height = np.concatenate([foot.height for foot in feet], axis=1)
    lowest = minimum_filter1d(height.min(axis=1), 2 * round(WINDOW_S * fps / 2.0) + 1, mode="nearest")
    return height - np.maximum(lowest, 0.0)[:, None]


def _kicked(pos_w: Positions, glide: Float[np.ndarray, " 2"], edges: tuple[int, int], fps: float) -> tuple[int, int]:
    """Edges [start, stop) of a slide, moved to the frames in which all bodies gain and lose its velocity."""
    velocity = np.diff(pos_w[..., :2], axis=0) * fps  # into frames 1 ...
    change = np.diff(velocity, axis=0)  # into frames 2 ...
    kicks = change[1:-1] - 0.5 * (change[:-2] + change[2:])  # into frames 3 ...: excess over the steps before and after
    reach, width, result, best = round(KICK_S * fps), max(1, round(KEPT_S * fps)), list(edges), np.inf
    for look in range(2):  # then with the velocity of the clearer step, which is more precise than the feet's
        estimate = glide
        for number, (edge, sign) in enumerate(zip(edges, (1.0, -1.0), strict=True)):
            first = max(edge - reach, 3)
            near = sign * kicks[first - 3 : edge + reach - 2]
            if not 0 < edge < len(pos_w) or not len(near):
                continue
            off, kick = _off(near, estimate)
            for frame in np.argsort(off, kind="stable")[: np.isfinite(off).sum()].tolist():
                if sign * _taken(velocity[:, 0] @ estimate, first + frame, width) > 0.0:
                    result[number] = first + frame
                    if look == 0 and off[frame] < best:
                        best, glide = off[frame], kick[frame]
                    break
    return (result[0], result[1]) if result[0] < result[1] else edges


def _off(
    kicks: Float[np.ndarray, "n 19 2"], glide: Float[np.ndarray, " 2"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 2"]]:
    """Deviation of each frame's velocity step from the slide's, infinite without a step; and that step [m/s]."""
    kick = np.median(kicks, axis=1)
    off = np.linalg.norm(kick - glide, axis=-1) / np.linalg.norm(glide)
    apart = np.percentile(np.linalg.norm(kicks - kick[:, None], axis=-1), MOST_BODIES, axis=1)
    spread = apart / np.maximum(np.linalg.norm(kick, axis=-1), 1e-9)
    return np.where((off < KICK_OFF) & (spread < KICK_SPREAD), off + spread, np.inf), kick


def _taken(speed: Float[np.ndarray, " s"], frame: int, width: int) -> float:
    """Mean over `width` steps from the step into `frame`, minus the mean over the steps before it."""
    return float(speed[frame - 1 : frame - 1 + width].mean() - speed[max(frame - 1 - width, 0) : frame - 1].mean())


def _evidence_of(speed: Float[np.ndarray, " t"], sliding: float) -> Float[np.ndarray, " t"]:
    """Evidence of each frame: 1 for sliding at `sliding` [m/s], -1 for stance, 0 where both feet swing."""
    share = speed / sliding
    return _steady(np.where(share <= TELLING, np.clip(2.0 * share - 1.0, -1.0, 1.0), 0.0), share)


def _near_ground(feet: Feet, fps: float, settings: ContactSettings) -> Float[np.ndarray, "t 4 2"]:
    """Velocities of balls and heels along the ground [m/s]; `FAST` for those that are not near it."""
    velocity = np.concatenate([foot.along_ground for foot in feet], axis=1)
    return np.where((_height(feet, fps) < settings.height)[..., None], velocity, FAST)


def _glide(velocity: Float[np.ndarray, "t 4 2"], span: slice, sliding: float) -> Float[np.ndarray, " 2"] | None:
    """Velocity [m/s] that some point has in most frames; None if there is no such velocity of at least `sliding`."""
    inside, glide = velocity[span], np.zeros(2)
    for _ in range(LOOKS):
        apart = np.linalg.norm(inside - glide, axis=-1)
        nearest = _of_point(inside, apart.argmin(axis=1))
        stands = apart.min(axis=1) < SWINGING * sliding
        if not stands.any():
            return None
        glide = np.median(nearest[stands], axis=0)
    return glide if float(np.linalg.norm(glide)) > STRAIGHT * sliding else None


def _evidence_by_way(velocity: Float[np.ndarray, "t 4 2"], glide: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " t"]:
    """Evidence of each frame: 1 where a point moves at `glide` [m/s], -1 where one is at rest, 0 where all swing."""
    size = float(np.linalg.norm(glide))
    stands = np.linalg.norm(velocity, axis=-1).min(axis=1) / size
    glides = np.linalg.norm(velocity - glide, axis=-1).min(axis=1) / size
    evidence = np.where(np.minimum(stands, glides) < NEAR, np.clip(stands - glides, -1.0, 1.0), 0.0)
    return _steady(evidence, stands)


def _steady(evidence: Float[np.ndarray, " t"], share: Float[np.ndarray, " t"]) -> Float[np.ndarray, " t"]:
    """Set the evidence for sliding to 0 in frames where the point accelerates, i.e. swings."""
    return np.where(np.abs(np.gradient(share)) < STEADY, evidence, np.minimum(evidence, 0.0))


def _most_evidence(evidence: Float[np.ndarray, " t"]) -> int:
    """Number of leading frames with the largest sum of evidence; the smallest such number."""
    return int(np.argmax(np.cumsum(evidence))) + 1


PLANT_SMOOTH_S = 0.05
"""Time over which the correcting velocity is smoothed, for a continuous body velocity [s]."""
PLANT_FADE_S = 0.1
"""Time over which the correcting velocity fades to zero beside the stretch that slides [s]."""


@dataclass(frozen=True, kw_only=True)
class Planted:
    """A clip with its feet planted."""

    clip: HumanClip
    mean_m_s: float
    """Mean speed of the correction [m/s]."""
    way_m: float
    """Displacement of the body by the correction over the clip [m]."""


def planted(clip: HumanClip, feet: Feet, contacts: Contacts, within: slice, highest_m_s: float) -> Planted:
    """Move the clip over the ground so that feet in contact are at rest, by at most `highest_m_s`.

    The slower of ball and heel of a foot in contact is planted; with both feet in contact, their mean. In flight the
    velocity is interpolated. Outside `within` the correcting velocity fades to zero.
    """
    slide = _slide(feet, contacts)
    smooth = gaussian_filter1d(slide[within], PLANT_SMOOTH_S * clip.fps, axis=0, mode="nearest")
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
    """Fade from 1 at 0 s to 0 at `PLANT_FADE_S`, with continuous slope."""
    return 1.0 - time_series.smoothstep(np.clip(away_s / PLANT_FADE_S, 0.0, 1.0))


def _slide(feet: Feet, contacts: Contacts) -> Float[np.ndarray, "t 2"]:
    """Horizontal velocity [m/s] of the feet in contact, interpolated over frames without contact."""
    velocities = [_of_point(foot.along_ground, foot.horizontal.argmin(axis=1)) for foot in feet]
    count = contacts.sum(axis=1)
    stands = np.flatnonzero(count)
    if not len(stands):
        return np.zeros((len(contacts), 2))
    total = sum(velocity * contacts[:, [side]] for side, velocity in enumerate(velocities))
    known = np.asarray(total)[stands] / count[stands, None]
    every = np.arange(len(contacts))
    return np.stack([np.interp(every, stands, known[:, axis]) for axis in range(2)], axis=1)


def _of_point(velocity: Float[np.ndarray, "t n 2"], point: np.ndarray) -> Float[np.ndarray, "t 2"]:
    """The velocity of one point in each frame."""
    return velocity[np.arange(len(velocity)), point]
