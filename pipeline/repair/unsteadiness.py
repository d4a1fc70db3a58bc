"""How far each body's step into a frame differs from the steps around it.

The step is compared with the median of five steps, and with the mean of its two neighbours. Both are the
size of the jump for a jump, and small for motion, however fast: constant acceleration gives zero. The smaller
of the two counts. The first and the last step have neighbours on one side only: there it is compared with
the next step and with the line through the next two.

A gap of a few frames is bridged by a cubic through the two frames on either side, and what is there is held against
it. For motion the miss goes with the fourth derivative, so it is far smaller than that of steps held against each
other (`unsteadiness`); for a spike it is the spike's size.
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
"""A bad frame disturbs the bridges of this many frames on either side."""


def interpolation_miss(values: Float[np.ndarray, "t n d"], gap: int) -> Float[np.ndarray, "t n d"]:
    """Middle of each window of `gap` frames less the cubic through the two frames on either side of it.

    Of an even gap the middle lies half a frame after its frame. Zero where the window has no neighbours.
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
    """Lengths of vectors of any dimension."""
    return np.sqrt(np.einsum("tnd,tnd->tn", vectors, vectors))


USUAL_PERCENTILE = 95.0
REFERENCE_HZ = 60.0
"""Limits on the measure hold at this rate and above."""


def slow_rate(fps: float) -> float:
    """How many times larger a limit is at a low rate, where a frame takes longer."""
    return max(1.0, REFERENCE_HZ / fps)


def turn_limits(settings: DetectionSettings) -> Float[np.ndarray, " 19"]:
    """Smallest turn of each body [rad] that counts as a jump: smaller where it moves other joints far."""
    return np.clip(settings.lever_jump / np.maximum(LEVER, 1e-3), settings.least_angle, settings.angle_jump)


def limits(
    size: Float[np.ndarray, "t n"], least: Float[np.ndarray, " n"], spread: float, usual: FrameMask
) -> Float[np.ndarray, " n"]:
    """Limit of each body: `least`, and `spread` times what 95 % of the `usual` frames stay below where some pass it."""
    result = least.copy()
    over = np.flatnonzero(size.max(axis=0) > least)
    if len(over):
        seen = size[:, over][usual] if usual.any() else size[:, over]
        result[over] = np.maximum(least[over], spread * np.percentile(seen, USUAL_PERCENTILE, axis=0))
    return result


@dataclass(frozen=True, kw_only=True)
class Unsteadiness:
    """How far each body's step into each frame differs from its neighbours; (t, 19), 0 for frame 0."""

    place: PerBody
    """Of the place in the parent's frame (pelvis: in the world) [m]."""
    turn: PerBody
    """Of the orientation in the parent's frame (pelvis: in the world) [rad]."""
    world: PerBody
    """Of the position in the world [m]."""
    world_turn: PerBody
    """Of the orientation in the world [rad]."""


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A clip as the detectors look at it; what several of them need is worked out once."""

    pos_w: Positions
    quat_w: Orientations

    @cached_property
    def local(self) -> tuple[Positions, Orientations]:
        """Places [m] and orientations in the parents' frames."""
        return to_local(self.pos_w, self.quat_w)

    @cached_property
    def continuous_local(self) -> Orientations:
        """Orientations in the parents' frames, without changes of sign from frame to frame."""
        return rotation.make_continuous(self.local[1])

    @cached_property
    def continuous(self) -> Orientations:
        """Orientations in the world, without changes of sign from frame to frame."""
        return rotation.make_continuous(self.quat_w)

    @cached_property
    def misses(self) -> tuple[PerBody, PerBody]:
        """`misses_over` a single frame."""
        return self.misses_over(1)

    def misses_over(self, gap: int) -> tuple[PerBody, PerBody]:
        """Miss of each body's turn [rad] and place [m] in its parent's frame over gaps centred at each frame."""
        turn = 2.0 * size_of(interpolation_miss(self.continuous_local, gap))
        return turn, size_of(interpolation_miss(self.local[0], gap))

    @cached_property
    def local_turns(self) -> Float[np.ndarray, "s 19 3"]:
        """Each body's turn in its parent's frame from frame to frame [rad]."""
        return _turns(self.local[1])

    @cached_property
    def world_turns(self) -> Float[np.ndarray, "s 19 3"]:
        """Each body's turn from frame to frame, in its own frame [rad]."""
        return _turns(self.quat_w)

    @cached_property
    def unsteadiness(self) -> Unsteadiness:
        """The measure of this module; the clip has at least four frames."""
        return Unsteadiness(
            place=_against_neighbours(np.diff(self.local[0], axis=0)),
            turn=_against_neighbours(self.local_turns),
            world=_against_neighbours(np.diff(self.pos_w, axis=0)),
            world_turn=_against_neighbours(self.world_turns),
        )


def _turns(quat: Orientations) -> Float[np.ndarray, "s 19 3"]:
    return rotation.to_rotvec(rotation.multiply(rotation.conjugate(quat[:-1]), quat[1:]))


def _against_neighbours(steps: Float[np.ndarray, "s 19 3"]) -> PerBody:
    """Size of what sets each step apart from the steps around it; one more row than `steps`."""
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
    """The middle one of five numbers, element by element, in a tenth of `np.median`'s time; NaN if one is NaN.

    Of four numbers neither the least nor the greatest is the middle one of the five.
    """
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e))


LONGEST_SPIKE_S, MOST_FRAMES = 0.02, 4
"""Spikes up to this long are sought; longer ones have edges that are jumps [s], [frames]."""
TOE_SHARE = 1.5
"""Toes bend so fast when they land that the limit of a clip's own toes is this many times as large."""
KNEE_SHARE = 1.4
"""Knees turn so fast when a foot lands that below 60 Hz their limit is up to this many times as large: in sound walks,
starts and steps back at 30 Hz they reach 1.25 times the limit that holds at 60 Hz."""
MOST_TIMES = 3.0
"""What a clip misses by makes its limits no more than so many times as large: sound files reach 2.2 times the least,
and in a short clip spikes themselves are among what it misses by."""
CLEAR = 3
"""A spike keeps this many frames away from a gap: bridges are a little off where they begin."""


def find_spikes(seen: Seen, lost: BodyMask, fps: float, settings: DetectionSettings) -> list[Defect]:
    """Bodies that are elsewhere for a few frames (`spike`); nothing beside samples that are `lost` already."""
    longest = int(np.clip(int(LONGEST_SPIKE_S * fps), 1, MOST_FRAMES))
    found: list[tuple[float, Defect]] = []
    for gap in range(1, longest + 1):
        if len(seen.pos_w) < gap + 2 * REACH + 2:
            break
        found += _candidates(seen, lost, gap, fps, settings)
    defects, taken = [], np.zeros(lost.shape, dtype=bool)
    for _, one in sorted(found, key=lambda each: (each[0], each[1].bodies, each[1].start), reverse=True):
        if not taken[one.start : one.stop, one.bodies[0]].any():
            taken[max(one.start - REACH, 0) : one.stop + REACH, one.bodies[0]] = True
            defects.append(one)
    return defects


def _candidates(
    seen: Seen, lost: BodyMask, gap: int, fps: float, settings: DetectionSettings
) -> list[tuple[float, Defect]]:
    """Windows of `gap` frames that are off, each with by how many times its limit."""
    turn, place = seen.misses if gap == 1 else seen.misses_over(gap)
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
    world_turn = 2.0 * size_of(interpolation_miss(seen.continuous, gap))
    world_place = size_of(interpolation_miss(seen.pos_w, gap))
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
