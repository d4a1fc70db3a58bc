"""Defects planted at random places are found where they are; sound clips are left alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import HumanClip, body
from pipeline.readers import read_motion
from pipeline.repair import RepairSettings
from pipeline.repair.detect import detect
from pipeline.repair.unsteadiness import MotionFeatures, find_spikes
from tests.factories.human_clips import Gait, standing, walker
from tests.factories.planted_defects import KINDS, plant

SEEDS = range(8)
LEAST = 1.5
"""Strength of what is counted here; `benchmarks/repair.py` counts from 1 on and takes hundreds."""
OF_FRAMES = [kind for kind in KINDS if not kind.startswith(("floor_", "foot_"))]


@pytest.fixture(scope="module")
def sound_clips() -> list[HumanClip]:
    return [
        walker(fps=120.0, seconds=5.0, noise=0.0003),
        walker(fps=60.0, gait=Gait(speed_m_s=0.8, stride_s=1.3)),
        walker(fps=30.0),
    ]


def marked_frames(clip: HumanClip, settings: RepairSettings) -> set[int]:
    """Frames that the detectors lay a finger on."""
    _, findings = detect(clip, settings.detection)
    mask = np.asarray(findings.lost.any(axis=1))
    for defect in findings.defects:
        mask[defect.start : defect.stop] = True
    return set(np.flatnonzero(mask)) | set(findings.cuts)


@pytest.mark.parametrize("kind", OF_FRAMES)
def test_planted_defect_is_found_within_two_frames_of_where_it_is(kind, sound_clips, settings):
    counted = 0
    for seed in SEEDS:
        clip = sound_clips[seed % len(sound_clips)]
        planted = plant(kind, clip, np.random.default_rng(seed))
        if planted.strength < LEAST:
            continue
        counted += 1
        marked = marked_frames(planted.clip, settings)
        where = f"seed {seed} at {clip.fps:g} Hz: frames [{planted.start}, {planted.stop}), marked {sorted(marked)}"
        assert marked, where
        off = max(2, 0.04 * clip.fps)
        assert planted.start - off <= min(marked) <= planted.first + off, where
        assert planted.last + 1 - off <= max(marked) + 1 <= max(planted.stop, planted.start + 1) + off, where
    assert counted >= 2


@pytest.mark.parametrize("fps", [25.0, 30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize("noise", [0.0, 0.0005])
def test_sound_walk_has_no_defects(fps, noise, settings):
    assert not marked_frames(walker(fps=fps, seconds=5.0, noise=noise), settings)


@pytest.mark.parametrize("name", ["walk", "walk_fast", "back", "side_left", "start_stop"])
@pytest.mark.parametrize("phase", [0, 1])
def test_legs_that_land_at_30_hz_are_no_spikes(root, name, phase, settings):
    """Every second frame of motions of 60 Hz, and the first five seconds of the walk: knees stretch within a frame."""
    whole = read_motion(root / f"data/motions/{name}.bvh", "clip").clip
    half = dataclasses.replace(
        whole, fps=30.0, body_pos_w=whole.body_pos_w[phase::2], body_quat_w=whole.body_quat_w[phase::2]
    )
    for clip in (half, half.cut(0, 150, "walk")) if name == "walk" else (half,):
        assert not marked_frames(clip, settings)


def test_a_spike_names_the_limit_that_it_passes(settings):
    clip, knee = walker(fps=60.0), body("left_knee")
    quat = clip.body_quat_w.copy()
    quat[100, knee] = rotation.multiply(quat[100, knee], rotation.from_rotvec(np.array([0.07, 0.0, 0.0])))
    nothing_lost = np.zeros((clip.frame_count, 19), dtype=bool)
    found = find_spikes(MotionFeatures(pos_w=clip.body_pos_w, quat_w=quat), nothing_lost, clip.fps, settings.detection)
    (spike,) = [one for one in found if one.bodies == (knee,)]
    assert spike.limit is not None and spike.value == pytest.approx(0.07, abs=0.01)
    assert 0.045 <= spike.limit < 0.06


def test_standing_still_is_not_frozen(settings):
    assert not marked_frames(standing(), settings)


def test_jump_of_a_fast_walker_is_not_hidden_by_his_speed(settings):
    clip = walker(fps=60.0, gait=Gait(speed_m_s=1.8, stride_s=0.9))
    pos = clip.body_pos_w.copy()
    pos[200:, :, 1] += 0.12
    assert marked_frames(dataclasses.replace(clip, body_pos_w=pos), settings) == {200}


def test_opening_bind_pose_is_found_and_only_it(settings):
    clip = walker(fps=120.0, seconds=4.0)
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    out = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0, 0.0])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = pos[0, body(f"{side}_shoulder")]
        for name, reach in (("elbow", 0.29), ("wrist", 0.54)):
            pos[0, body(f"{side}_{name}")] = shoulder + np.array([0.0, sign * reach, 0.0])
        for name in ("shoulder", "elbow", "wrist"):
            quat[0, body(f"{side}_{name}")] = out * [1.0, sign, 1.0, 1.0]
    spoilt = dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat)
    assert marked_frames(spoilt, settings) == {0}


def test_every_frame_twice_marks_every_second_frame(settings):
    clip = walker(fps=30.0, seconds=4.0)
    twice = dataclasses.replace(
        clip,
        fps=60.0,
        body_pos_w=np.repeat(clip.body_pos_w, 2, axis=0),
        body_quat_w=np.repeat(clip.body_quat_w, 2, axis=0),
        contacts=None,
    )
    marked = marked_frames(twice, settings)
    assert set(range(1, twice.frame_count, 2)) <= marked
    assert len(marked) <= 0.55 * twice.frame_count


def test_locked_elbow_that_moves_on_without_a_jump_is_sound(settings):
    clip = walker(fps=60.0)
    upper, lower = body("left_shoulder"), body("left_elbow")
    bend = np.maximum(0.3 * np.sin(2 * np.pi * np.arange(clip.frame_count) / 66.0), 0.0)
    quat = clip.body_quat_w.copy()
    quat[:, lower] = rotation.multiply(quat[:, upper], rotation.from_axis_angle(np.array([0.0, -1.0, 0.0]), bend))
    quat[:, body("left_wrist")] = quat[:, lower]
    pos = clip.body_pos_w.copy()
    pos[:, body("left_wrist")] = pos[:, lower] + rotation.rotate(quat[:, lower], np.array([0.0, 0.0, -0.25]))
    assert not marked_frames(dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat), settings)


def test_sign_flips_of_quaternions_are_not_jumps(settings):
    clip = walker(fps=60.0)
    quat = clip.body_quat_w * np.random.default_rng(3).choice([-1.0, 1.0], size=(clip.frame_count, 19, 1))
    assert not marked_frames(dataclasses.replace(clip, body_quat_w=quat), settings)


@pytest.mark.parametrize(("frames", "moves", "matters"), [(2, True, False), (3, True, True), (12, False, False)])
def test_freeze_matters_from_three_frames_of_a_body_that_moves_on(frames, moves, matters):
    clip = walker(fps=120.0) if moves else standing(fps=120.0)
    planted = plant("frozen", clip, np.random.default_rng(0), seconds=frames / 120.0)
    assert planted.stop - planted.start == frames
    assert (planted.strength >= 1.0) == matters


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_joint_that_keeps_its_place_for_three_frames_while_it_moves_is_found(fps, settings):
    clip = walker(fps=fps)
    head, start = body("head"), clip.frame_count // 2
    pos = clip.body_pos_w.copy()
    pos[start : start + 3, head] = pos[start - 1, head]
    marked = marked_frames(dataclasses.replace(clip, body_pos_w=pos), settings)
    assert {start, start + 1, start + 2} <= marked <= set(range(start - 2, start + 5))


def test_toe_that_is_left_behind_by_its_ankle_is_found_from_where_it_stops(settings):
    clip = walker(fps=60.0)
    toe, start = body("left_toe"), 200
    pos = clip.body_pos_w.copy()
    pos[start : start + 30, toe] = pos[start - 1, toe]
    marked = marked_frames(dataclasses.replace(clip, body_pos_w=pos), settings)
    assert set(range(start, start + 30)) <= marked <= set(range(start - 2, start + 32))


def test_planted_foot_is_not_blamed_for_its_knee_that_is_elsewhere(settings):
    clip = walker(fps=60.0)
    ankle, knee = body("left_ankle"), body("left_knee")
    pos = clip.body_pos_w.copy()
    pos[200:230, ankle] = pos[199, ankle]
    pos[200:230, body("left_toe")] = pos[199, body("left_toe")]
    lengths = np.linalg.norm(pos[199, ankle] - pos[199, knee])
    way = pos[200:230, knee] - pos[199, ankle]
    pos[200:230, knee] = pos[199, ankle] + lengths * way / np.linalg.norm(way, axis=-1, keepdims=True)
    pos[214, knee, 1] += 0.05
    _, findings = detect(dataclasses.replace(clip, body_pos_w=pos), settings.detection)
    assert not [one for one in findings.defects if "leg moves on" in one.text]
