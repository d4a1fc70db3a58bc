"""The axes of the joints' frames in a file against those a skeleton map speaks of.

A program that exports z up instead of y up turns the frames of all joints by the same quarter turns. The
map's words (`up: y`) then mean other axes, which shows in the rest pose: hips and head lie elsewhere in
the pelvis' frame.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.skeleton_map import CANONICAL, SkeletonMap

MIN_COSINE = np.cos(np.deg2rad(35.0))
"""How well the rest pose has to agree with quarter turns: between no turn and a quarter turn lies 45 degrees."""


def with_axes_of_map(motion: RawMotion, skeleton: SkeletonMap) -> RawMotion:
    """The motion with its joints' frames turned to those that the map speaks of; unchanged where they are."""
    turn = _quarter_turns(motion, skeleton)
    if np.array_equal(turn, np.eye(3)):
        return motion
    tips = {joint: tuple(float(value) for value in np.array(place) @ turn) for joint, place in motion.tips.items()}
    return dataclasses.replace(
        motion, rest_offset=motion.rest_offset @ turn, frame_turn=rotation.from_matrix(turn), tips=tips
    )


def _quarter_turns(motion: RawMotion, skeleton: SkeletonMap) -> Float[np.ndarray, "3 3"]:
    """Rotation from the map's joint axes to the file's; identity where the rest pose does not show it."""
    bodies = skeleton.bodies
    pelvis = bodies["pelvis"].joint
    try:
        left = motion.offset_between(pelvis, bodies["left_hip"].joint)
        right = motion.offset_between(pelvis, bodies["right_hip"].joint)
        head = motion.offset_between(pelvis, bodies["head"].joint)
    except KeyError:
        return np.eye(3)
    expected = rotation.to_matrix(skeleton.rest_frame(motion, "pelvis")) @ np.column_stack(
        [CANONICAL["left"], CANONICAL["up"]]
    )
    found = np.column_stack([rotation.normalize(left - right), rotation.normalize(head - 0.5 * (left + right))])
    fits = [turn for turn in _ALL_TURNS if np.sum((turn @ expected) * found, axis=0).min() > MIN_COSINE]
    return fits[0] if len(fits) == 1 else np.eye(3)


def _turns() -> list[np.ndarray]:
    """The 24 rotations that map axes to axes."""
    signed = [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]
    return [matrix for matrix in signed if np.linalg.det(matrix) > 0.0]


_ALL_TURNS = _turns()
