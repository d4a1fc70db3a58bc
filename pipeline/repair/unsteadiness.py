"""Unsteadiness: how far each body's step into a frame differs from the steps around it. Detection of spikes.

The step is compared with the median of five steps, and with the mean of its two neighbours. For a jump, both
differences are the size of the jump; for motion, however fast, they are small: zero for constant acceleration. The
smaller one is used. The first and the last step have neighbours on one side only: they are compared with the next step
and with the line through the next two.

For spikes, a few frames are interpolated by a cubic through the two frames on either side and compared with it. For
motion, this interpolation error is proportional to the fourth derivative, and so far smaller than the unsteadiness; for
a spike it is the size of the spike.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.repair.defect import Defect, names
from pipeline.repair.settings import DetectionSettings
from pipeline.repair.tree import KNEES, LEVER, TOES, BodyMask, FrameMask, Orientations, PerBody, Positions, to_local

REACH = 2
"""Number of frames on either side whose interpolation a bad frame affects."""


def interpolation_miss(values: Float[np.ndarray, "t n d"], gap: int) -> Float[np.ndarray, "t n d"]:
    """Interpolation error: middle of each window of `gap` frames minus the cubic through two frames on either side.

    For an even gap the middle is half a frame after its frame. Zero where the window has no neighbours.
    """
    inner, outer = (gap + 1) / 2.0, (gap + 3) / 2.0
    near = outer**2 / (outer**2 - inner**2) / 2.0
    width = gap + 2 * REACH
    count = len(values) - width + 1
    result = np.zeros(values.shape)
    if count < 1:
        return result

    def at(offset: int) -> np.ndarray:
        return values[offset : offset + count]

    first = REACH + (gap - 1) // 2
    middle = at(first) if gap % 2 else 0.5 * (at(first) + at(first + 1))
    sides = near * (at(1) + at(width - 2)) + (0.5 - near) * (at(0) + at(width - 1))
    result[first : first + count] = middle - sides
    return result


def size_of(vectors: Float[np.ndarray, "t n d"]) -> Float[np.ndarray, "t n"]:
    """Euclidean norms along the last axis."""
    return np.sqrt(np.einsum("tnd,tnd->tn", vectors, vectors))


USUAL_PERCENTILE = 95.0
REFERENCE_HZ = 60.0
"""Frame rate from which the limits on the unsteadiness are constant [Hz]."""


def slow_rate(fps: float) -> float:
    """Factor on a limit at a frame rate below `REFERENCE_HZ`."""
    return max(1.0, REFERENCE_HZ / fps)


def turn_limits(settings: DetectionSettings) -> Float[np.ndarray, " 19"]:
    """Smallest rotation of each body [rad] that counts as a jump; smaller for bodies that move other joints far."""
    return np.clip(settings.lever_jump / np.maximum(LEVER, 1e-3), settings.least_angle, settings.angle_jump)


def limits(
    size: Float[np.ndarray, "t n"], least: Float[np.ndarray, " n"], spread: float, usual: FrameMask
) -> Float[np.ndarray, " n"]:
    """Limit of each body: the larger of `least` and `spread` times the 95th percentile of its `usual` frames."""
    result = least.copy()
    over = np.flatnonzero(size.max(axis=0) > least)
    if len(over):
        usual_size = size[:, over][usual] if usual.any() else size[:, over]
        result[over] = np.maximum(least[over], spread * np.percentile(usual_size, USUAL_PERCENTILE, axis=0))
    return result


@dataclass(frozen=True, kw_only=True)
class Unsteadiness:
    """How far each body's step into each frame differs from its neighbours; (t, 19), 0 for frame 0."""

    place: PerBody
    """Of the position in the parent's frame (pelvis: in the world) [m]."""
    turn: PerBody
    """Of the orientation in the parent's frame (pelvis: in the world) [rad]."""
    world: PerBody
    """Of the position in the world [m]."""
    world_turn: PerBody
    """Of the orientation in the world [rad]."""


@dataclass(frozen=True, kw_only=True)
class MotionFeatures:
    """A clip's poses with derived quantities that several detectors use, computed once."""

    pos_w: Positions
    quat_w: Orientations

    @cached_property
    def local(self) -> tuple[Positions, Orientations]:
        """Positions [m] and orientations in the parents' frames."""
        return to_local(self.pos_w, self.quat_w)

    @cached_property
    def continuous_local(self) -> Orientations:
        """Sign-continuous orientations in the parents' frames."""
        return rotation.make_continuous(self.local[1])

    @cached_property
    def continuous(self) -> Orientations:
        """Sign-continuous orientations in the world."""
        return rotation.make_continuous(self.quat_w)

    @cached_property
    def misses(self) -> tuple[PerBody, PerBody]:
        """`misses_over(1)`: interpolation errors of single frames."""
        return self.misses_over(1)

    def misses_over(self, gap: int) -> tuple[PerBody, PerBody]:
        """Interpolation errors of each body's rotation [rad] and position [m] in its parent's frame, for gaps centred
        at each frame."""
        turn = 2.0 * size_of(interpolation_miss(self.continuous_local, gap))
        return turn, size_of(interpolation_miss(self.local[0], gap))

    @cached_property
    def local_turns(self) -> Float[np.ndarray, "s 19 3"]:
        """Rotation vector of each body from frame to frame, in its parent's frame [rad]."""
        return _turns(self.local[1])

    @cached_property
    def world_turns(self) -> Float[np.ndarray, "s 19 3"]:
        """Rotation vector of each body from frame to frame, in its own frame [rad]."""
        return _turns(self.quat_w)

    @cached_property
    def unsteadiness(self) -> Unsteadiness:
        """The unsteadiness of each body; the clip needs at least four frames."""
        return Unsteadiness(
            place=_against_neighbours(np.diff(self.local[0], axis=0)),
            turn=_against_neighbours(self.local_turns),
            world=_against_neighbours(np.diff(self.pos_w, axis=0)),
            world_turn=_against_neighbours(self.world_turns),
        )


def _turns(quat: Orientations) -> Float[np.ndarray, "s 19 3"]:
    return rotation.to_rotvec(rotation.multiply(rotation.conjugate(quat[:-1]), quat[1:]))


def _against_neighbours(steps: Float[np.ndarray, "s 19 3"]) -> PerBody:
    """Difference of each step from the steps around it; one more row than `steps`."""
    count = len(steps)
    padded = np.pad(np.moveaxis(steps, -1, 0), ((0, 0), (2, 2), (0, 0)), mode="reflect")
    around = [padded[:, shift : shift + count] for shift in range(5)]
    off_median, off_mean = around[2] - _median_of_five(*around), around[2] - (around[1] + around[3]) / 2.0
    size = np.minimum(*(rotation.length(np.moveaxis(off, 0, -1)) for off in (off_median, off_mean)))
    for end, second, third in ((0, 1, 2), (-1, -2, -3)):
        line = 2.0 * steps[second] - steps[third]
        size[end] = np.minimum(*(rotation.length(steps[end] - other) for other in (steps[second], line)))
    return np.concatenate([np.zeros((1, steps.shape[1])), size])


def _median_of_five(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Elementwise median of five numbers, ten times as fast as `np.median`; NaN if one is NaN.

    Neither the least nor the greatest of four of the numbers can be the median of the five.
    """
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e))


LONGEST_SPIKE_S, MOST_FRAMES = 0.02, 4
"""Longest spikes that are detected [s], [frames]; longer ones have edges that are jumps."""
TOE_SHARE = 1.5
"""Factor on the clip's own limit for toes, which bend fast at touchdown."""
KNEE_SHARE = 1.4
"""Largest factor on the limit for knees below 60 Hz, since knees turn fast at touchdown: in sound walks, starts and
steps back at 30 Hz they reach 1.25 times the limit of 60 Hz."""
MOST_TIMES = 3.0
"""Largest factor by which a clip's own errors raise its limits: sound files reach 2.2 times the least, and in a short
clip the spikes themselves contribute to its errors."""
CLEAR = 3
"""Frames next to a gap in which spikes are ignored, because interpolated gaps deviate slightly at their ends."""


def find_spikes(features: MotionFeatures, lost: BodyMask, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Bodies that leave their motion for a few frames (`spike`); not next to samples that are already `lost`."""
    longest = int(np.clip(int(LONGEST_SPIKE_S * fps), 1, MOST_FRAMES))
    found: list[tuple[float, Defect]] = []
    for gap in range(1, longest + 1):
        if len(features.pos_w) < gap + 2 * REACH + 2:
            break
        found += _candidates(features, lost, gap, fps, settings)
    defects, taken = [], np.zeros(lost.shape, dtype=bool)
    for _, one in sorted(found, key=lambda each: (each[0], each[1].bodies, each[1].start), reverse=True):
        if not taken[one.start : one.stop, one.bodies[0]].any():
            taken[max(one.start - REACH, 0) : one.stop + REACH, one.bodies[0]] = True
            defects.append(one)
    return defects


def _candidates(
    features: MotionFeatures, lost: BodyMask, gap: int, fps: float, settings: DetectionSettings
) -> list[tuple[float, Defect]]:
    """Windows of `gap` frames whose error exceeds the limit, each with the ratio of error to limit."""
    turn, place = features.misses if gap == 1 else features.misses_over(gap)
    least = turn_limits(settings) * (settings.spike_turn / settings.angle_jump)
    usual = np.asarray(~lost.any(axis=1))
    turn_limit = limits(turn, least, settings.spike_spread, usual)
    place_limit = limits(place, np.full(place.shape[1], settings.position_jump), settings.spike_spread, usual)
    place_limit[0] = max(place_limit[0], settings.root_jump)
    toes = list(TOES)
    turn_limit[toes] = np.where(turn_limit[toes] > least[toes], TOE_SHARE * turn_limit[toes], turn_limit[toes])
    turn_limit = np.minimum(turn_limit, MOST_TIMES * least)
    turn_limit[list(KNEES)] *= min(KNEE_SHARE, slow_rate(fps))
    size = np.maximum(turn / turn_limit, place / place_limit)
    if not (size > 1.0).any():
        return []
    world_turn = 2.0 * size_of(interpolation_miss(features.continuous, gap))
    world_place = size_of(interpolation_miss(features.pos_w, gap))
    visible = (world_turn > least / 2.0) | (world_place > settings.position_jump / 2.0)
    visible[:, 0] = True
    result = []
    for frame, index in np.argwhere((size > 1.0) & visible):
        start = int(frame) - (gap - 1) // 2
        stop = start + gap
        if lost[max(start - CLEAR, 0) : stop + CLEAR, index].any():
            continue
        angle, limit = float(turn[frame, index]), float(turn_limit[index])
        defect = Defect(
            code="spike",
            text=f"{names([int(index)])} is {np.rad2deg(angle):.0f} deg off what the frames around say",
            start=start,
            stop=stop,
            bodies=(int(index),),
            pos=bool(place[frame, index] > place_limit[index]),
            value=angle,
            limit=limit if angle > limit else None,
            unit="rad",
        )
        result.append((float(size[frame, index]), defect))
    return result
