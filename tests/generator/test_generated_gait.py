"""Feet, knees, flight, speed and smoothness of the motions that ship, measured on the finished clips."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline import rotation, time_series
from pipeline.clips.human_clip import HumanClip
from pipeline.generator import RECIPES, generate
from pipeline.generator.command import Level, Recipe
from tests.factories.generated import shipped, steady

NAMES = sorted(RECIPES)
RUNS = ["run_easy", "run_fast"]
HEEL_FROM_ANKLE = np.array([-0.055, 0.0, -0.08325])
BALL_HEIGHT = 0.025
T1_ANKLE_PITCH = (-0.87, 0.35)  # facts of the robot: toes up negative
T1_KNEE_SPEED = 12.57


def heel_w(clip: HumanClip, side: str) -> np.ndarray:
    return clip.pos(f"{side}_ankle") + rotation.rotate(clip.quat(f"{side}_ankle"), HEEL_FROM_ANKLE)


def knee_rad(clip: HumanClip, side: str) -> np.ndarray:
    thigh = clip.pos(f"{side}_knee") - clip.pos(f"{side}_hip")
    shank = clip.pos(f"{side}_ankle") - clip.pos(f"{side}_knee")
    cosine = np.sum(thigh * shank, axis=-1) / np.linalg.norm(thigh, axis=-1) / np.linalg.norm(shank, axis=-1)
    return np.arccos(cosine)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("foot, side", [(0, "left"), (1, "right")])
def test_a_planted_foot_stands_on_a_point_that_slides_less_than_a_millimetre(name, foot, side):
    clip = shipped(name).clip
    toe, heel = clip.pos(f"{side}_toe"), heel_w(clip, side)
    for start, stop in time_series.runs(clip.contacts[:, foot]):
        ball_down = np.abs(toe[start:stop, 2] - BALL_HEIGHT) < 5e-4
        heel_down = np.abs(heel[start:stop, 2]) < 5e-4
        assert (ball_down | heel_down).all()
        for point, down in ((toe[start:stop], ball_down), (heel[start:stop], heel_down)):
            for first, last in time_series.runs(down):
                assert np.ptp(point[first:last, :2], axis=0).max() < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_no_part_of_a_sole_goes_below_the_floor_and_swinging_feet_are_off_it(name):
    clip = shipped(name).clip
    for foot, side in enumerate(("left", "right")):
        lowest = np.minimum(heel_w(clip, side)[:, 2], clip.pos(f"{side}_toe")[:, 2] - BALL_HEIGHT)
        assert lowest.min() > -5e-4
        assert np.abs(lowest[clip.contacts[:, foot]]).max() < 2e-3
        swings = [run for run in time_series.runs(~clip.contacts[:, foot]) if run[0] > 0 and run[1] < len(lowest)]
        assert all(lowest[start:stop].max() > 0.03 for start, stop in swings)


@pytest.mark.parametrize("name", RUNS)
def test_a_run_falls_with_gravity_whenever_both_feet_are_off(name):
    clip = shipped(name).clip
    flight = ~clip.contacts.any(axis=1)
    inside = flight[2:] & flight[1:-1] & flight[:-2]
    acceleration = np.diff(clip.pos("pelvis")[:, 2], 2) * clip.fps**2
    assert inside.sum() > 60
    np.testing.assert_allclose(acceleration[inside], -9.81, rtol=0.02)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in RUNS])
def test_a_walk_always_has_a_foot_on_the_ground(name):
    assert shipped(name).clip.contacts.any(axis=1).all()


@pytest.mark.parametrize("name", NAMES)
def test_knees_bend_forward_and_stay_within_a_leg_s_reach(name):
    clip = shipped(name).clip
    for side in ("left", "right"):
        hip, knee, ankle = (clip.pos(f"{side}_{part}") for part in ("hip", "knee", "ankle"))
        ahead = rotation.rotate(clip.quat(f"{side}_hip"), np.array([1.0, 0.0, 0.0]))
        assert np.sum((knee - (hip + ankle) / 2.0) * ahead, axis=-1).min() > 0.0
        angle = knee_rad(clip, side)
        assert angle.min() > 0.15
        assert angle.max() < 2.1
        assert np.abs(time_series.derivative(angle, clip.fps)).max() < T1_KNEE_SPEED


@pytest.mark.parametrize("name", NAMES)
def test_ankles_stay_within_the_range_of_the_robot(name):
    clip = shipped(name).clip
    for side in ("left", "right"):
        local = rotation.multiply(rotation.conjugate(clip.quat(f"{side}_knee")), clip.quat(f"{side}_ankle"))
        matrix = rotation.to_matrix(local)
        pitch = np.arctan2(matrix[:, 0, 2], matrix[:, 0, 0])
        assert T1_ANKLE_PITCH[0] < pitch.min()
        assert pitch.max() < T1_ANKLE_PITCH[1]


@pytest.mark.parametrize("name", NAMES)
def test_feet_keep_clear_of_each_other_and_arms_of_the_trunk(name):
    clip = shipped(name).clip
    across = clip.pos("left_ankle") - clip.pos("right_ankle")
    across_b = rotation.rotate_inverse(rotation.about_z(rotation.yaw_of(clip.quat("pelvis"))), across)
    assert across_b[:, 1].min() > 0.12
    for side, sign in (("left", 1.0), ("right", -1.0)):
        elbow_b = rotation.rotate_inverse(clip.quat("chest"), clip.pos(f"{side}_elbow") - clip.pos("chest"))
        assert (sign * elbow_b[:, 1]).min() > 0.2


@pytest.mark.parametrize("name", NAMES)
def test_each_level_has_the_speed_that_was_asked_for(name):
    recipe, clip = RECIPES[name], shipped(name).clip
    hips = clip.pos("left_hip") - clip.pos("right_hip")
    heading = np.unwrap(np.arctan2(-hips[:, 0], hips[:, 1]))
    velocity = rotation.rotate_inverse(rotation.about_z(heading), time_series.derivative(clip.pos("pelvis"), clip.fps))
    start_s = 0.0
    for level in recipe.levels:
        if recipe.name != "start_stop" and level.command != (0.0, 0.0, 0.0):
            frames = slice(round(start_s * clip.fps), round((start_s + level.hold_s) * clip.fps))
            mean, asked = velocity[frames, :2].mean(axis=0), np.array([level.forward, level.lateral])
            turned = (heading[frames][-1] - heading[frames][0]) / (level.hold_s - 1.0 / clip.fps)
            if np.linalg.norm(asked) > 0.0:
                assert mean @ asked / (asked @ asked) == pytest.approx(1.0, abs=0.03)
            assert np.linalg.norm(mean - asked) < 0.05
            assert turned == pytest.approx(level.yaw_rate, rel=0.03, abs=0.06)
        start_s += level.hold_s + recipe.ramp_s


@pytest.mark.parametrize(
    "gait, levels",
    [
        ("walk", (Level(hold_s=1.0), Level(hold_s=2.0, forward=1.2, yaw_rate=0.4), Level(hold_s=2.0))),
        ("walk", (Level(hold_s=1.0, lateral=0.7),)),
        ("walk", (Level(hold_s=1.0, forward=-0.8),)),
        ("run", (Level(hold_s=1.0, forward=2.3), Level(hold_s=1.0, forward=3.2))),
    ],
)
def test_position_velocity_and_acceleration_have_no_steps(gait, levels):
    """Halving the time between samples halves a continuous acceleration's largest change; a step would stay."""
    largest = []
    for fps in (240.0, 480.0):
        clip = generate(Recipe(name="x", what="", levels=levels, seed=3, gait=gait, fps=fps)).clip
        acceleration = np.diff(clip.body_pos_w, 2, axis=0) * fps**2
        largest.append(np.abs(np.diff(acceleration, axis=0)).max(axis=(0, 2)))
    assert (largest[1] < 0.62 * largest[0] + 1e-2).all()


@pytest.mark.parametrize(
    "gait, speed, steps_a_minute, contact",
    [
        ("walk", 1.3, (105.0, 120.0), (0.58, 0.64)),  # Perry and Burnfield 2010: 113 steps/min, stance 62 %
        ("walk", 1.9, (125.0, 145.0), (0.54, 0.60)),
        ("run", 3.0, (155.0, 175.0), (0.30, 0.37)),  # Nilsson and Thorstensson 1987, 1989
    ],
)
def test_rhythm_agrees_with_published_gait(gait, speed, steps_a_minute, contact):
    clip = steady(gait, speed).clip
    landings = np.flatnonzero(np.diff(clip.contacts[:, 0].astype(int)) == 1)
    stride_s = np.diff(landings).mean() / clip.fps
    assert steps_a_minute[0] < 120.0 / stride_s < steps_a_minute[1]
    assert contact[0] < clip.contacts[landings[0] + 1 : landings[-1] + 1].mean() < contact[1]


def test_the_pelvis_rises_and_falls_as_in_published_gait():
    """Orendurff et al. 2004: 4.8 cm at 1.6 m/s; at a run Novacheck 1998: 6 to 10 cm."""
    assert np.ptp(steady("walk", 1.6).clip.pos("pelvis")[:, 2]) == pytest.approx(0.0483, abs=0.003)
    assert 0.05 < np.ptp(steady("run", 3.0).clip.pos("pelvis")[:, 2]) < 0.10


def test_a_run_that_stands_is_refused():
    recipe = Recipe(name="x", what="", levels=(Level(hold_s=1.0),), seed=0, gait="run")
    with pytest.raises(ValueError, match="can't stand still"):
        generate(recipe)


def test_a_stop_that_is_too_short_is_refused():
    levels = (Level(hold_s=2.0, forward=1.0), Level(hold_s=0.1), Level(hold_s=2.0, forward=1.0))
    with pytest.raises(ValueError, match="hold it longer"):
        generate(Recipe(name="x", what="", levels=levels, seed=0))


def test_steps_beyond_a_leg_s_reach_are_refused():
    recipe = Recipe(name="x", what="", levels=(Level(hold_s=2.0, forward=4.5),), seed=0)
    with pytest.raises(ValueError, match="shorter or quicker"):
        generate(recipe)
