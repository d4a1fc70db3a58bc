"""Shaking is told from the frame in which it begins to that in which it ends, and of nothing else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip, body
from pipeline.repair import RepairSettings
from pipeline.repair.detect import detect
from pipeline.repair.shaking import find_noise
from pipeline.repair.tree import to_local
from pipeline.repair.unsteadiness import MotionFeatures
from tests.factories.defect_draft import LIMBS, Draft
from tests.factories.human_clips import walker

SEEDS = range(6)


def shaken(clip: HumanClip, start: int, stop: int, joints: tuple[int, ...], size: float, seed: int) -> HumanClip:
    """Rotations of joints that shake by `size` [rad] about each axis in the frames [start, stop)."""
    rng = np.random.default_rng(seed)
    draft = Draft.of(clip, start, stop, rng)
    local = to_local(draft.pos, draft.quat)[1][draft.span]
    turns = rotation.from_rotvec(rng.normal(0.0, size, (stop - start, len(joints), 3)))
    draft.turn(draft.span, {index: rotation.multiply(local[:, index], turns[:, n]) for n, index in enumerate(joints)})
    return dataclasses.replace(clip, body_pos_w=draft.pos, body_quat_w=draft.quat)


def told(clip: HumanClip, settings: RepairSettings) -> tuple[int, int]:
    """First frame of all that shakes and the first after it."""
    features = MotionFeatures(pos_w=clip.body_pos_w, quat_w=clip.body_quat_w)
    found = find_noise(features, clip.fps, settings.detection)
    assert found
    return min(one.start for one in found), max(one.stop for one in found)


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
@pytest.mark.parametrize("size_deg", [6.0, 25.0])
def test_shaking_of_a_limb_is_told_within_a_frame_of_its_ends(fps, size_deg, settings):
    clip = walker(fps=fps, seconds=5.0, noise=0.0003)
    off = []
    for seed in SEEDS:
        start = round((1.5 + 0.13 * seed) * fps)
        stop = start + round(0.4 * fps)
        first, last = told(shaken(clip, start, stop, LIMBS[seed % 4], np.deg2rad(size_deg), seed), settings)
        off += [first - start, last - stop]
    assert np.abs(off).max() <= 2, off
    assert np.mean(np.abs(off) <= 1) >= 0.8, off


def test_shaking_that_is_a_third_of_a_clip_is_found(settings):
    clip = walker(fps=30.0, seconds=2.0)
    start, stop = told(shaken(clip, 20, 40, LIMBS[1], np.deg2rad(5.0), 1), settings)
    assert abs(start - 20) <= 2
    assert abs(stop - 40) <= 2


def test_pose_that_is_kept_until_it_shakes_is_not_frozen(settings):
    clip = walker(fps=60.0)
    knee = body("left_knee")
    draft = Draft.of(clip, 200, 230, np.random.default_rng(0))
    held = to_local(draft.pos, draft.quat)[1][draft.span, knee].copy()
    held[:] = held[0]
    before = to_local(draft.pos, draft.quat)[1][draft.start - 6 : draft.start, knee]
    draft.turn(draft.span, {knee: held})
    slowing = rotation.slerp(before, held[:1].repeat(6, axis=0), np.linspace(0.0, 1.0, 6))
    draft.turn(slice(194, 200), {knee: slowing})
    locked = dataclasses.replace(clip, body_pos_w=draft.pos, body_quat_w=draft.quat)
    _, findings = detect(shaken(locked, 230, 260, LIMBS[0], np.deg2rad(15.0), 2), settings.detection)
    held_too = [one for one in findings.defects if one.code in ("frozen_joint", "dropout") and one.stop <= 231]
    assert not held_too
    assert findings.lost[232:258, knee].all()


def test_sound_walk_does_not_shake(settings):
    for fps in (30.0, 60.0, 120.0):
        clip = walker(fps=fps, noise=0.0005)
        assert not find_noise(MotionFeatures(pos_w=clip.body_pos_w, quat_w=clip.body_quat_w), fps, settings.detection)
