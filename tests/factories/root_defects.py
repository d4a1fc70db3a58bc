"""Defects of the whole body's way: jumps, feet that slide, a floor that is elsewhere."""

from __future__ import annotations

import numpy as np

from pipeline import rotation
from tests.factories.defect_draft import Draft

TELEPORT_M = 0.10
HEADING_RAD = np.deg2rad(15.0)
SKATE_M_S = 0.15
FLOOR_M = 0.03
"""The least that matters of each."""


def teleport(draft: Draft) -> None:
    """The whole body is elsewhere on the ground from a frame on, for good or for a while."""
    angle, size = draft.rng.uniform(-np.pi, np.pi), draft.size(TELEPORT_M)
    draft.strength = size / TELEPORT_M
    stays = bool(draft.rng.integers(2))
    last = len(draft.pos) if stays else draft.stop
    draft.pos[draft.start : last] += size * np.array([np.cos(angle), np.sin(angle), 0.0])
    if stays:
        draft.stop = draft.start


def heading_jump(draft: Draft) -> None:
    """From a frame on the person faces elsewhere and goes there."""
    angle = min(draft.size(HEADING_RAD), np.pi)
    draft.strength = angle / HEADING_RAD
    turn = rotation.about_z(draft.rng.choice([-1.0, 1.0]) * angle)
    centre = draft.pos[draft.start, 0] * [1.0, 1.0, 0.0]
    draft.pos[draft.start :] = rotation.rotate(turn, draft.pos[draft.start :] - centre) + centre
    draft.quat[draft.start :] = rotation.multiply(turn, draft.quat[draft.start :])
    draft.stop = draft.start


def foot_skate(draft: Draft) -> None:
    """For a while the body glides over the ground, or to the end; standing feet slide at that speed."""
    angle, speed = draft.rng.uniform(-np.pi, np.pi), draft.size(SKATE_M_S, high=4.0)
    draft.strength = speed / SKATE_M_S
    if draft.rng.integers(2):
        draft.start, draft.stop = 0, len(draft.pos)
    way = np.zeros(len(draft.pos))
    way[draft.span] = np.arange(1, draft.stop - draft.start + 1) * speed / draft.fps
    way[draft.stop :] = way[draft.stop - 1] if draft.stop < len(way) else 0.0
    draft.pos += way[:, None, None] * np.array([np.cos(angle), np.sin(angle), 0.0])


def floor_offset(draft: Draft) -> None:
    """The ground is not at z = 0."""
    size = draft.size(FLOOR_M)
    draft.strength = size / FLOOR_M
    draft.start, draft.stop = 0, len(draft.pos)
    draft.size_m = float(draft.rng.choice([-1.0, 1.0])) * size
    draft.pos[..., 2] += draft.size_m


def floor_drift(draft: Draft) -> None:
    """The ground rises or sinks steadily from the clip's beginning to its end."""
    size = draft.size(FLOOR_M)
    draft.strength = size / FLOOR_M
    draft.start, draft.stop = 0, len(draft.pos)
    draft.size_m = float(draft.rng.choice([-1.0, 1.0])) * size
    draft.pos[..., 2] += draft.size_m * np.linspace(0.0, 1.0, len(draft.pos))[:, None]
