"""How far each body's step into a frame differs from the steps around it.

The step is compared with the median of five steps, and with the mean of its two neighbours. Both are the
size of the jump for a jump, and small for motion, however fast: constant acceleration gives zero. The smaller
of the two counts. The first and the last step have neighbours on one side only: there it is compared with
the next step and with the line through the next two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.repair.tree import Orientations, Positions, to_local

REFERENCE_HZ = 60.0
"""Limits on the measure hold at this rate and above."""


def slow_rate(fps: float) -> float:
    """How many times larger a limit is at a low rate, where a frame takes longer."""
    return max(1.0, REFERENCE_HZ / fps)


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


def unsteadiness(pos_w: Positions, quat_w: Orientations) -> Unsteadiness:
    """The measure of this module for all bodies of a clip of at least four frames."""
    offset, turn = to_local(pos_w, quat_w)
    return Unsteadiness(
        place=_against_neighbours(np.diff(offset, axis=0)),
        turn=_against_neighbours(turn_steps(turn)),
        world=_against_neighbours(np.diff(pos_w, axis=0)),
        world_turn=_against_neighbours(turn_steps(quat_w)),
    )


def turn_steps(quat: Orientations) -> Float[np.ndarray, "s 19 3"]:
    return rotation.to_rotvec(rotation.multiply(rotation.conjugate(quat[:-1]), quat[1:]))


def _against_neighbours(steps: Float[np.ndarray, "s 19 3"]) -> Float[np.ndarray, "t 19"]:
    """Size of what sets each step apart from the steps around it; one more row than `steps`."""
    count = len(steps)
    padded = np.pad(steps, ((2, 2), (0, 0), (0, 0)), mode="reflect")
    median = np.median(np.stack([padded[shift : shift + count] for shift in range(5)]), axis=0)
    neighbours = (padded[1 : count + 1] + padded[3 : count + 3]) / 2.0
    size = np.minimum(np.linalg.norm(steps - median, axis=-1), np.linalg.norm(steps - neighbours, axis=-1))
    for end, second, third in ((0, 1, 2), (-1, -2, -3)):
        line = 2.0 * steps[second] - steps[third]
        apart = [np.linalg.norm(steps[end] - other, axis=-1) for other in (steps[second], line)]
        size[end] = np.minimum(*apart)
    return np.concatenate([np.zeros((1, steps.shape[1])), size])
