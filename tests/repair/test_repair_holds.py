"""Rests of a person and poses that a recording holds are told from each other by how they are taken up and left."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip, body
from pipeline.generator import RECIPES, generate
from pipeline.repair import RepairSettings
from pipeline.repair.detect import detect
from pipeline.repair.holds import Hold, Limits, aligned, find_holds
from tests.factories.human_clips import walker

STILL_STEP = 1e-6
LIMITS = Limits(jump=0.003, short=0.05, entering=0.2, frames=3, longest=200.0, excursion=40.0)
PERIOD, REST = 100, 30
"""Frames of a joint's bend, and of them those at rest."""


def bending() -> np.ndarray:
    """Angle (t, 1) of a joint that rests at 0 for a while in every period and bends by half a radian between."""
    phase = np.arange(420) % PERIOD
    bend = 0.25 * (1.0 - np.cos(2 * np.pi * (phase - REST) / (PERIOD - REST)))
    return np.where(phase < REST, 0.0, bend)[:, None]


def holds_of(value: np.ndarray, unknown: np.ndarray | None = None) -> list[tuple[int, int, bool]]:
    """What is held of a signal (t, 1), as (start, stop, entered by a jump)."""
    step = np.diff(value[:, 0], prepend=value[0, 0] + 1.0)
    around = np.stack([np.roll(step, shift) for shift in (-2, -1, 0, 1, 2)])
    jump = np.minimum(np.abs(step - np.median(around, axis=0)), np.abs(step - (around[1] + around[3]) / 2.0))
    jump[[0, -1]] = 0.0
    unknown = np.zeros(len(value), dtype=bool) if unknown is None else unknown
    found = find_holds(np.abs(step) < STILL_STEP, value, jump, unknown, LIMITS)
    return [(one.start, one.stop, one.entered) for one in found]


def test_rests_that_are_taken_up_and_left_smoothly_are_the_persons_own():
    assert holds_of(bending()) == []


@pytest.mark.parametrize("length", [3, 8, 25])
def test_pose_that_is_kept_once_and_jumps_out_is_held_from_where_it_stops(length):
    value = bending()
    value[145 : 145 + length] = value[144]
    assert holds_of(value) == [(145, 145 + length, False)]


def test_pose_that_a_joint_jumps_into_and_out_of_is_held_even_for_two_frames():
    value = bending()
    value[155:157] = 0.0
    assert holds_of(value) == [(155, 157, True)]


def test_own_rest_that_goes_on_too_long_is_held_from_where_other_rests_end():
    value = bending()
    value[100:160] = 0.0
    ((start, stop, entered),) = holds_of(value)
    assert (stop, entered) == (160, False)
    assert abs(start - (100 + REST)) <= 2


def test_own_rest_that_is_jumped_into_too_early_is_held_until_other_rests_begin():
    value = bending()
    value[180:200] = 0.0
    ((start, stop, entered),) = holds_of(value)
    assert (start, entered) == (180, True)
    assert abs(stop - 200) <= 2


def test_locked_joint_that_jumps_out_of_every_rest_is_left_alone():
    value = bending()
    value[value > 0.0] += 0.05
    assert holds_of(value) == []


@pytest.mark.parametrize("start", [110, 128])
def test_spike_within_or_at_the_end_of_a_rest_does_not_make_it_held(start):
    value = bending()
    value[start : start + 2, 0] += [0.4, 0.3]
    assert holds_of(value) == []


def test_what_shakes_between_two_halves_of_a_rest_does_not_make_them_held():
    value = bending()
    value[108:120, 0] += np.random.default_rng(0).normal(scale=0.2, size=12)
    assert holds_of(value) == []


def test_jump_beside_a_bridged_gap_tells_nothing():
    value, unknown = bending(), np.zeros(420, dtype=bool)
    value[145:170] = value[144]
    unknown[168:175] = True
    assert holds_of(value, unknown) == []


def test_hold_that_may_have_begun_with_a_rest_begins_where_another_body_is_held():
    sure = Hold(start=50, stop=90, entered=True, first=50, last=90)
    unsure = Hold(start=61, stop=90, entered=False, first=40, last=90)
    assert aligned([[sure], [unsure]])[1] == [dataclasses.replace(unsure, start=50)]
    elsewhere = dataclasses.replace(unsure, stop=91, last=91)
    assert aligned([[sure], [elsewhere]])[1] == [elsewhere]


def held(clip: HumanClip, settings: RepairSettings) -> list[tuple[str, int, int]]:
    _, findings = detect(clip, settings.detection)
    return [(one.code, one.start, one.stop) for one in findings.defects]


def test_neck_held_for_a_few_frames_by_less_than_two_degrees_is_found(settings):
    clip = walker(fps=60.0)
    neck, chest, head = body("neck"), body("chest"), body("head")
    nod = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.1 * np.sin(np.arange(clip.frame_count) / 9.0))
    quat = clip.body_quat_w.copy()
    quat[:, neck] = rotation.multiply(quat[:, chest], nod)
    quat[:, head] = quat[:, neck]
    assert held(dataclasses.replace(clip, body_quat_w=quat), settings) == []
    quat[200:204, neck] = rotation.multiply(quat[200:204, chest], nod[199])
    quat[200:204, head] = quat[200:204, neck]
    assert held(dataclasses.replace(clip, body_quat_w=quat), settings) == [("frozen_joint", 200, 204)]


def test_toe_that_stands_and_is_then_left_behind_is_held_from_where_its_bone_is_pulled(settings):
    clip = generate(RECIPES["walk"]).clip
    toe = body("left_toe")
    still = np.abs(np.diff(clip.body_pos_w[:, toe], axis=0)).max(axis=1) < 1e-6
    start, stop = next((low, high) for low, high in time_series.runs(still) if low > 200)
    pos = clip.body_pos_w.copy()
    pos[stop : stop + 15, toe] = pos[stop, toe]
    marked = [one for one in held(dataclasses.replace(clip, body_pos_w=pos), settings) if one[0] == "frozen_joint"]
    assert marked
    assert start + 20 < stop - 2 <= min(begin for _, begin, _ in marked) <= stop + 10
    assert max(end for *_, end in marked) == stop + 15
