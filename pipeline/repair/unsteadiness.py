"""How far each body's step into a frame differs from the steps around it.

The step is compared with the median of five steps, and with the mean of its two neighbours. Both are the
size of the jump for a jump, and small for motion, however fast: constant acceleration gives zero. The smaller
of the two counts. The first and the last step have neighbours on one side only: there it is compared with
the next step and with the line through the next two.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.repair.bridge_miss import interpolation_miss, size_of
from pipeline.repair.tree import LEVER, Orientations, Positions, to_local

USUAL_PERCENTILE = 95.0
REFERENCE_HZ = 60.0
"""Limits on the measure hold at this rate and above."""


def slow_rate(fps: float) -> float:
    """How many times larger a limit is at a low rate, where a frame takes longer."""
    return max(1.0, REFERENCE_HZ / fps)


def turn_limits(moved: float, least: float, most: float) -> Float[np.ndarray, " 19"]:
    """Turn of each body [rad] that moves a joint below it by `moved` [m], within `least` and `most`."""
    return np.clip(moved / np.maximum(LEVER, 1e-3), least, most)


def limits(
    size: Float[np.ndarray, "t n"], least: Float[np.ndarray, " n"], spread: float, usual: Bool[np.ndarray, " t"]
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

    place: Float[np.ndarray, "t 19"]
    """Of the place in the parent's frame (pelvis: in the world) [m]."""
    turn: Float[np.ndarray, "t 19"]
    """Of the orientation in the parent's frame (pelvis: in the world) [rad]."""
    world: Float[np.ndarray, "t 19"]
    """Of the position in the world [m]."""
    world_turn: Float[np.ndarray, "t 19"]
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
    def misses(self) -> tuple[Float[np.ndarray, "t 19"], Float[np.ndarray, "t 19"]]:
        """`misses_over` a single frame."""
        return self.misses_over(1)

    def misses_over(self, gap: int) -> tuple[Float[np.ndarray, "t 19"], Float[np.ndarray, "t 19"]]:
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


def _against_neighbours(steps: Float[np.ndarray, "s 19 3"]) -> Float[np.ndarray, "t 19"]:
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
