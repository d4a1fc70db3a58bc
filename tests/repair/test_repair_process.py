"""What KP2 makes of a window: gaps filled or cut, pieces placed, smoothed, labelled, with reasons."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import FEET, HumanClip, body
from pipeline.clips.outcome import Outcome
from pipeline.errors import ClipError
from pipeline.repair import process
from pipeline.repair.floor import Placement
from pipeline.repair.tree import LIMB_ENDS, bone_lengths
from tests.factories.human_clips import Gait, standing, turned, walker
from tests.factories.planted_defects import plant

FEET_JOINTS = [body(f"{side}_{name}") for side in FEET for name in ("ankle", "toe")]


def spoilt(clip: HumanClip, change) -> HumanClip:
    """The clip with `change(pos, quat)` applied."""
    pos, quat = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    change(pos, quat)
    return dataclasses.replace(clip, body_pos_w=pos, body_quat_w=quat)


def in_source_world(outcome: Outcome, number: int = 0) -> HumanClip:
    """A piece with its placement undone."""
    piece = outcome.pieces[number]
    names = (field.name for field in dataclasses.fields(Placement))
    return Placement(**{name: piece.numbers[name] for name in names}).undone(piece.clip)


def codes(outcome: Outcome, effect: str) -> set[str]:
    return {reason.code for reason in outcome.reasons if reason.effect == effect}


def test_sound_clip_comes_back_within_5_mm_and_1_degree(settings):
    clip = turned(walker(fps=60.0, noise=0.0005), 2.1, (3.0, -2.0, 0.4))
    outcome = process(clip, {"skill": "walk"}, settings=settings)
    back = in_source_world(outcome)
    moved = np.linalg.norm(back.body_pos_w - clip.body_pos_w, axis=-1)
    turn = rotation.angle_between(back.body_quat_w, clip.body_quat_w)
    assert np.sqrt(np.mean(moved**2, axis=0)).max() < 0.005
    assert np.sqrt(np.mean(turn**2, axis=0)).max() < np.deg2rad(1.0)
    assert codes(outcome, "repaired") == {"floor_offset"}
    assert len(outcome.reasons) == 1


def test_piece_starts_at_the_origin_on_the_ground_and_faces_x(settings):
    clip = turned(walker(fps=60.0), -1.3, (5.0, 7.0, -0.6))
    piece = process(clip, {"start_frame": 100, "stop_frame": 300, "skill": "walk"}, settings=settings).pieces[0]
    assert piece.clip.frame_count == 200
    np.testing.assert_allclose(piece.clip.pos("pelvis")[0, :2], 0.0, atol=1e-9)
    ahead = rotation.rotate(piece.clip.quat("pelvis")[:12], np.array([1.0, 0.0, 0.0])).mean(axis=0)
    assert abs(np.arctan2(ahead[1], ahead[0])) < 1e-6
    assert piece.numbers["floor_m"] == pytest.approx(-0.6 + 0.02 - settings.floor.ball_height, abs=0.005)
    assert piece.numbers["heading_rad"] == pytest.approx(-1.3, abs=0.1)


@pytest.mark.parametrize("height", [-0.4, 0.0, 1.2])
def test_floor_is_found_within_5_mm_of_where_it_was_put(height, settings):
    reference = process(walker(fps=60.0), {}, settings=settings).numbers["floor_m"]
    lifted = process(turned(walker(fps=60.0), 0.0, (0.0, 0.0, height)), {}, settings=settings).numbers["floor_m"]
    assert lifted - reference == pytest.approx(height, abs=1e-6)


@pytest.mark.parametrize("drift_m", [-0.3, -0.12, 0.05, 0.2])
def test_drifting_floor_is_levelled(drift_m, settings):
    clip = walker(fps=60.0)
    tilt = np.linspace(0.0, drift_m, clip.frame_count)[:, None]

    def sink(pos, quat):
        pos[..., 2] += tilt

    outcome = process(spoilt(clip, sink), {}, settings=settings)
    drift = next(reason for reason in outcome.reasons if reason.code == "floor_drift")
    assert drift.value == pytest.approx(drift_m, abs=0.005)
    level = outcome.pieces[0].clip.pos("pelvis")[:, 2]
    sound = process(clip, {}, settings=settings).pieces[0].clip.pos("pelvis")[:, 2]
    assert np.abs(level - sound).max() < 0.005
    assert np.abs(in_source_world(outcome).body_pos_w - clip.body_pos_w - tilt[..., None] * [0, 0, 1]).max() < 0.02


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_smoothing_has_no_lag_and_keeps_a_running_bounce(fps, settings):
    time_s = np.arange(round(6 * fps)) / fps
    clip = walker(fps=fps, seconds=6.0)
    bounce = 0.05 * np.sin(2 * np.pi * 2.8 * time_s)

    def jump(pos, quat):
        pos[..., 2] += bounce[:, None]

    generous = dataclasses.replace(
        settings, contact=dataclasses.replace(settings.contact, slip_limit_m_s=9.0, longest_flight_s=9.0)
    )
    outcome = process(spoilt(clip, jump), {"skill": "run"}, settings=generous)
    height = in_source_world(outcome).pos("pelvis")[:, 2] - clip.pos("pelvis")[:, 2]
    inner = slice(round(fps), -round(fps))
    basis = np.stack([np.sin(2 * np.pi * 2.8 * time_s), np.cos(2 * np.pi * 2.8 * time_s), np.ones_like(time_s)], axis=1)
    (in_phase, quarter, _), *_ = np.linalg.lstsq(basis[inner], height[inner], rcond=None)
    assert np.hypot(in_phase, quarter) > 0.95 * 0.05
    assert abs(np.arctan2(quarter, in_phase)) < 2 * np.pi * 2.8 * 0.001


def test_limb_bones_keep_their_lengths(settings):
    clip = plant("missing_frames", walker(fps=60.0), np.random.default_rng(4), seconds=0.2).clip
    lengths = bone_lengths(process(clip, {}, settings=settings).pieces[0].clip.body_pos_w)[:, list(LIMB_ENDS)]
    assert np.ptp(lengths, axis=0).max() < 1e-3


@pytest.mark.parametrize(
    ("seconds", "all_joints", "feet"), [(0.1, 0.004, 0.006), (0.2, 0.008, 0.015), (0.4, 0.03, 0.04)]
)
def test_gaps_are_filled_close_to_what_was_there(seconds, all_joints, feet, settings):
    clip = walker(fps=60.0, gait=Gait(stride_s=1.13), noise=0.0003)
    errors = []
    for seed in range(6):
        planted = plant("missing_frames", clip, np.random.default_rng(seed), seconds=seconds)
        outcome = process(planted.clip, {}, settings=settings)
        made = in_source_world(outcome).body_pos_w[planted.start : planted.stop]
        errors.append(np.linalg.norm(made - clip.body_pos_w[planted.start : planted.stop], axis=-1) ** 2)
        assert codes(outcome, "repaired") == {"missing"}
        assert outcome.numbers["filled_frames"] == planted.stop - planted.start
        told = next(reason for reason in outcome.reasons if reason.code == "missing")
        assert (told.start_s, told.stop_s) == (planted.start / 60.0, planted.stop / 60.0)
        assert ("estimate" in told.text) == (seconds > 0.15)
    assert np.sqrt(np.mean(errors)) < all_joints
    assert np.sqrt(np.mean([error[:, FEET_JOINTS] for error in errors])) < feet


def test_lost_limb_is_filled_without_touching_the_rest(settings):
    clip = walker(fps=60.0)
    leg = [body(f"left_{name}") for name in ("hip", "knee", "ankle", "toe")]

    def drop(pos, quat):
        pos[200:220, leg] = np.nan
        quat[200:220, leg] = np.nan

    made = in_source_world(process(spoilt(clip, drop), {}, settings=settings))
    apart = np.linalg.norm(made.body_pos_w - clip.body_pos_w, axis=-1)
    others = [index for index in range(19) if index not in leg]
    assert apart[:, others].max() < 0.005
    assert apart[200:220, leg].max() < 0.04


def test_gap_beyond_half_a_second_is_cut_out_and_makes_two_pieces(settings):
    clip = walker(fps=60.0)

    def drop(pos, quat):
        pos[200:240, body("right_wrist")] = np.nan

    outcome = process(spoilt(clip, drop), {"skill": "walk"}, settings=settings)
    assert [piece.clip.name for piece in outcome.pieces] == ["walker+1", "walker+2"]
    frames = [(piece.numbers["start_frame"], piece.numbers["stop_frame"]) for piece in outcome.pieces]
    assert frames == [(0, 200), (240, 480)]
    assert codes(outcome, "rejected") == {"missing"}
    assert outcome.numbers["cut_frames"] == 40


def test_nothing_crosses_a_teleport(settings):
    clip = walker(fps=60.0)

    def jump(pos, quat):
        pos[240:, :, 1] += 0.6

    outcome = process(spoilt(clip, jump), {}, settings=settings)
    halves = [in_source_world(outcome, number) for number in (0, 1)]
    alone = [
        in_source_world(process(clip, {"start_frame": a, "stop_frame": b}, settings=settings))
        for a, b in ((0, 240), (240, 480))
    ]
    assert {reason.code for reason in outcome.reasons} == {"teleport"}
    for half, whole, shift in zip(halves, alone, (0.0, 0.6), strict=True):
        np.testing.assert_allclose(half.body_pos_w - [0.0, shift, 0.0], whole.body_pos_w, atol=0.002)


def test_frozen_tail_is_cut(settings):
    def freeze(pos, quat):
        pos[390:], quat[390:] = pos[390], quat[390]

    outcome = process(spoilt(walker(fps=60.0), freeze), {}, settings=settings)
    assert outcome.pieces[0].clip.frame_count == 391
    assert codes(outcome, "rejected") == {"frozen"}


def test_swapped_sides_are_put_right(settings):
    clip = walker(fps=60.0)
    planted = plant("swapped_sides", clip, np.random.default_rng(1), seconds=0.7)
    outcome = process(planted.clip, {}, settings=settings)
    assert codes(outcome, "repaired") == {"swapped_sides"}
    assert np.abs(in_source_world(outcome).body_pos_w - clip.body_pos_w).max() < 0.02


@pytest.mark.parametrize("lost", [1, 4])
def test_samples_that_are_missing_while_sides_are_exchanged_are_filled(settings, lost):
    clip = walker(fps=60.0)
    planted = plant("swapped_sides", clip, np.random.default_rng(1), seconds=0.7)
    pos = planted.clip.body_pos_w.copy()
    middle = (planted.start + planted.stop) // 2
    pos[middle : middle + lost, body("left_wrist")] = np.nan
    outcome = process(dataclasses.replace(planted.clip, body_pos_w=pos), {}, settings=settings)
    assert codes(outcome, "repaired") == {"swapped_sides", "missing"}
    assert np.abs(in_source_world(outcome).body_pos_w - clip.body_pos_w).max() < 0.02


def test_defect_outside_the_window_is_not_told_and_does_not_matter(settings):
    def drop(pos, quat):
        pos[20:80] = np.nan

    outcome = process(spoilt(walker(fps=60.0), drop), {"start_frame": 200, "stop_frame": 400}, settings=settings)
    assert not outcome.reasons
    assert outcome.pieces[0].clip.frame_count == 200


def test_short_remainders_are_dropped_with_a_reason(settings):
    def drop(pos, quat):
        pos[20:60] = np.nan

    outcome = process(spoilt(walker(fps=60.0), drop), {}, settings=settings)
    assert [piece.clip.name for piece in outcome.pieces] == ["walker"]
    assert codes(outcome, "rejected") == {"missing", "too_short"}


def test_sliding_feet_are_rejected(settings):
    sliding = walker(fps=60.0, gait=Gait(slide_m_s=0.3))
    outcome = process(sliding, {"skill": "walk"}, settings=settings)
    assert not outcome.pieces
    skate = next(reason for reason in outcome.reasons if reason.code == "foot_skate")
    assert skate.value == pytest.approx(0.3, abs=0.06)


def test_person_who_glides_is_rejected(settings):
    def drift(pos, quat):
        pos[..., 0] += 1.5 * np.arange(len(pos))[:, None] / 60.0

    assert "foot_skate" in codes(process(spoilt(standing(), drift), {}, settings=settings), "rejected")


def test_clip_of_nothing_but_nan_is_an_outcome(settings):
    def drop(pos, quat):
        pos[:], quat[:] = np.nan, np.nan

    outcome = process(spoilt(standing(), drop), {}, settings=settings)
    assert not outcome.pieces
    assert "missing" in codes(outcome, "rejected")


@pytest.mark.parametrize("count", [1, 2, 4, 7, 31])
def test_short_clips_are_outcomes(count, settings):
    outcome = process(standing().cut(0, count, "short"), {}, settings=settings)
    assert bool(outcome.pieces) == (count >= 30)


def test_window_outside_the_clip_is_an_error(settings):
    with pytest.raises(ClipError, match=r"the window is \[10, 9999\)"):
        process(standing(), {"start_frame": 10, "stop_frame": 9999}, settings=settings)


def test_same_input_gives_the_same_bytes(settings):
    clip = plant("limb_dropout", walker(fps=60.0), np.random.default_rng(0), seconds=0.3).clip
    first, second = (process(clip, {"skill": "walk"}, settings=settings) for _ in range(2))
    assert first.reasons == second.reasons
    assert first.pieces[0].clip.body_pos_w.tobytes() == second.pieces[0].clip.body_pos_w.tobytes()


def test_input_is_not_written_to(settings):
    clip = plant("limb_dropout", walker(fps=60.0), np.random.default_rng(0)).clip
    before = clip.body_pos_w.copy(), clip.body_quat_w.copy()
    process(clip, {}, settings=settings)
    np.testing.assert_array_equal(clip.body_pos_w, before[0])
    np.testing.assert_array_equal(clip.body_quat_w, before[1])
