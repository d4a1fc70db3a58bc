"""Feet near the ground that are too fast to stand: found where nothing is labelled, and no stride, hop or stance is."""

import dataclasses

import numpy as np
import pytest

from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings, assess
from pipeline.feasibility.criterion import Skipped, Verdict
from pipeline.feasibility.foot_criteria import foot_slip, gliding
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.robot import Robot
from tests.factories.robot_clips import standing


def _unlabelled(robot: Robot, seconds: float = 2.0) -> RobotClip:
    return dataclasses.replace(standing(robot, seconds), contacts=None)


def _carried(clip: RobotClip, speed: np.ndarray) -> RobotClip:
    """Carried forward, feet and all, at a speed a frame [m/s]."""
    path = np.cumsum(speed)[:, None] / clip.fps * np.array([1.0, 0.0, 0.0])
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + path)


def _lifted(clip: RobotClip, height: np.ndarray | float) -> RobotClip:
    up = np.broadcast_to(height, clip.frame_count)[:, None] * np.array([0.0, 0.0, 1.0])
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + up)


def _verdict(motion: Motion, limits: FeasibilitySettings) -> Verdict:
    (found,) = gliding(motion, limits.feet)
    return found


def test_feet_that_slide_too_fast_to_stand_are_found_said_and_blamed(robot: Robot, limits: FeasibilitySettings):
    clip = _unlabelled(robot)
    frames = np.arange(clip.frame_count)
    motion = motion_of(_carried(clip, np.where((frames >= 40) & (frames < 55), 1.2, 0.0)), robot, limits)
    broken = {verdict.code: verdict for verdict in assess(motion, limits).broken}
    found = broken["foot_glide_s"]
    assert found.value == pytest.approx(0.3, abs=0.041), "speed is a difference over three frames"
    assert found.text.startswith("from 0.80 s on feet glide for 0.3")
    assert found.text.endswith("within 1 cm of the ground, and none slow enough to stand")
    assert found.bad is not None
    assert not found.bad[:39].any()
    assert found.bad[41:54].all()
    assert not found.bad[57:].any()


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_a_robot_that_slides_on_one_foot_glides(robot: Robot, limits: FeasibilitySettings, side: str):
    """The other foot is held up by a bent leg, high over the ground."""
    clip = _unlabelled(robot)
    joints = clip.joint_pos.copy()
    joints[:, robot.joint(f"{side}_Hip_Pitch")] -= 0.6
    joints[:, robot.joint(f"{side}_Knee_Pitch")] += 0.9
    bent = dataclasses.replace(clip, joint_pos=joints)
    frames = np.arange(clip.frame_count)
    motion = motion_of(_carried(bent, np.where((frames >= 40) & (frames < 55), 1.2, 0.0)), robot, limits)
    assert np.sort(motion.sole.height.mean(axis=0))[1] > 0.05
    found = _verdict(motion, limits)
    assert found.value == pytest.approx(0.3, abs=0.041) and not found.holds


@pytest.mark.parametrize("height", [0.005, 0.02, 0.1])
def test_a_hop_is_not_one(robot: Robot, limits: FeasibilitySettings, height: float):
    """Up and down again as a stone flies, from and to feet that stand."""
    clip = _unlabelled(robot)
    times_s = np.arange(clip.frame_count) / clip.fps - 1.0
    flight = np.maximum(height - 0.5 * 9.81 * times_s**2, 0.0)
    assert _verdict(motion_of(_lifted(clip, flight), robot, limits), limits).holds


def test_who_stands_does_not_glide_and_who_floats_above_the_ground_is_told_by_flight(
    robot: Robot, limits: FeasibilitySettings
):
    assert _verdict(motion_of(_unlabelled(robot), robot, limits), limits).value == 0.0
    floats = motion_of(_lifted(_unlabelled(robot), 0.05), robot, limits)
    broken = {verdict.code for verdict in assess(floats, limits).broken}
    assert "flight_s" in broken
    assert "foot_glide_s" not in broken


def _strides(robot: Robot, limits: FeasibilitySettings, speed: float, glides_s: float) -> Motion:
    """It stands for 3 s and goes at a speed [m/s] for 3 s, in strides of .4 s that end with a glide [s]."""
    clip = _unlabelled(robot, 6.0)
    frames = np.arange(clip.frame_count)
    motion = motion_of(_carried(clip, np.where(frames < 150, 0.0, speed)), robot, limits)
    stands = (frames < 175) | (frames % 20 < 20 - round(glides_s * clip.fps))
    return dataclasses.replace(motion, contacts=np.repeat(stands[:, None], 2, axis=1))


@pytest.mark.parametrize(("speed", "glides_s", "holds"), [(1.8, 0.2, True), (1.8, 0.24, False), (0.4, 0.2, False)])
def test_a_run_may_glide_for_longer_than_a_walk_by_the_speed_of_that_time(
    robot: Robot, limits: FeasibilitySettings, speed: float, glides_s: float, holds: bool
):
    found = _verdict(_strides(robot, limits, speed, glides_s), limits)
    assert found.value == pytest.approx(glides_s)
    assert found.limit == pytest.approx(0.08 + 0.075 * speed, rel=0.02), "the second before, it stood"
    assert found.holds == holds


@pytest.mark.parametrize("labels", ["both", "left", "none", "unknown"])
def test_feet_that_slide_are_found_whatever_is_labelled(robot: Robot, limits: FeasibilitySettings, labels: str):
    """.08 m/s to and fro, which labelled feet may: the soles tell that both are down all the same."""
    clip = _carried(standing(robot), np.where(np.arange(100) % 50 < 25, 0.08, -0.08))
    told = {"both": [True, True], "left": [True, False], "none": [False, False]}
    contacts = np.tile(told[labels], (clip.frame_count, 1)) if labels in told else None
    motion = motion_of(dataclasses.replace(clip, contacts=contacts), robot, limits)
    found = {verdict.code: verdict for verdict in foot_slip(motion, limits.feet)}
    of_soles = found["foot_inferred_slip_mean"]
    assert of_soles.value == pytest.approx(0.08, abs=0.005)
    assert of_soles.limit == pytest.approx(0.05, abs=0.005)
    assert not of_soles.holds
    assert of_soles.bad is not None
    assert of_soles.bad[1:-1].all()
    assert isinstance(found["foot_slip_mean"], Verdict) == (labels in told)
    if labels in told:
        assert found["foot_slip_mean"].value == pytest.approx(0.0 if labels == "none" else 0.08, abs=0.005)
        assert found["foot_slip_mean"].limit == pytest.approx(0.1, abs=0.005)


def test_of_two_feet_that_the_soles_tell_to_be_down_the_slower_one_is_held_to_stand(
    robot: Robot, limits: FeasibilitySettings
):
    motion = motion_of(standing(robot), robot, limits)
    velocity = motion.sole.corner_vel_w.copy()
    velocity[:, 1, :, 0] = 0.3
    on_its_way = dataclasses.replace(motion, sole=dataclasses.replace(motion.sole, corner_vel_w=velocity))
    found = {verdict.code: verdict for verdict in foot_slip(on_its_way, limits.feet)}
    assert found["foot_inferred_slip_mean"].value == pytest.approx(0.0, abs=0.001)
    assert found["foot_slip_mean"].value == pytest.approx(0.15, abs=0.001), "the label says that it stands"


def test_a_foot_that_leaves_as_the_other_comes_down_is_not_held_to_stand(robot: Robot, limits: FeasibilitySettings):
    """Of the one that comes down no slip is asked in its first frame, and yet it is the one that stands."""
    motion = motion_of(_unlabelled(robot), robot, limits)
    frames = np.arange(motion.clip.frame_count)
    contacts = np.stack([frames <= 51, frames >= 50], axis=1)
    velocity = motion.sole.corner_vel_w.copy()
    velocity[50, 0, :, 0] = 0.9
    soles = dataclasses.replace(motion.sole, corner_vel_w=velocity)
    found = {
        verdict.code: verdict
        for verdict in foot_slip(dataclasses.replace(motion, sole=soles, contacts=contacts), limits.feet)
    }
    assert found["foot_inferred_slip_mean"].value == pytest.approx(0.0, abs=1e-3)


def test_labels_are_taken_at_their_word(robot: Robot, limits: FeasibilitySettings):
    clip = _carried(standing(robot), np.full(100, 1.2))
    nowhere = dataclasses.replace(clip, contacts=np.zeros((clip.frame_count, 2), dtype=bool))
    (found,) = gliding(motion_of(nowhere, robot, limits), limits.feet)
    assert found == Skipped(code="foot_glide_s", not_applicable="contacts are labelled")
