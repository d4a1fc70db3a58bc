"""The benchmark of weak motors in references: the tracker holds a pose that the robot can hold and loses one that it
cannot, a plant is what it says, and only plants that matter are counted."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from benchmarks.feasibility_references import Found, Plant, bars_of, standing_needs, weakened
from benchmarks.feasibility_tracker import STEP_S, Followed, follow, moved
from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.motion import Motion, motion_of
from pipeline.files import settings
from pipeline.robot import Robot
from tests.factories.robot_clips import standing

GRAVITY = 9.81


@pytest.fixture(scope="module")
def limits(root: Path) -> FeasibilitySettings:
    return settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)


@pytest.fixture(scope="module")
def motion(robot: Robot, limits: FeasibilitySettings) -> Motion:
    return motion_of(standing(robot, 1.0), robot, limits)


@pytest.fixture(scope="module")
def stood(motion: Motion, limits: FeasibilitySettings) -> Followed:
    return follow(motion, limits.torque)


def test_a_robot_that_can_stand_stands_without_help(robot, stood):
    assert moved(robot, stood.qpos, stood.reference_qpos).max() < 0.005
    weight = robot.total_mass * GRAVITY
    late = np.abs(stood.help_w[round(0.3 / STEP_S) :])
    assert late[:, :3].max() < 0.02 * weight
    assert late[:, 3:5].max() < 0.002 * weight


def test_with_the_same_help_the_same_robot_goes_the_same_way(robot, motion, stood, limits):
    again = follow(motion, limits.torque, held=stood)
    np.testing.assert_array_equal(again.qpos, stood.qpos)


def test_with_the_same_help_a_robot_with_weak_legs_does_not_stay_where_it_was(robot, motion, stood, limits):
    legs = [index for index, name in enumerate(robot.joint_names) if "Knee" in name or "Hip" in name or "Ankle" in name]
    weak = robot
    for joint in legs:
        weak = weakened(weak, joint, 0.2 * float(np.abs(stood.torque[100:, joint]).max()))
    lost = follow(dataclasses.replace(motion, robot=weak), limits.torque, held=stood)
    assert np.all(np.abs(lost.torque) <= weak.torque_limit + 1e-9)
    assert moved(robot, lost.qpos, stood.qpos).max() > 0.05
    helped = follow(dataclasses.replace(motion, robot=weak), limits.torque)
    assert moved(robot, helped.qpos, stood.qpos).max() < 0.05, "any help at the root would hold it"


def test_a_motor_is_planted_by_the_least_that_it_gave_while_its_leg_stood_alone(robot):
    count, hip = 200, robot.joint("Left_Hip_Roll")
    torque = np.zeros((count, len(robot.joint_names)))
    torque[:, hip] = -np.linspace(0.0, 20.0, count)
    contacts = np.zeros((count, 2), dtype=bool)
    contacts[100:150, 0] = True
    contacts[150:, :] = True
    still = np.zeros((count, 6))
    needs = standing_needs(
        Followed(qpos=still, torque=torque, help_w=still, reference_qpos=still, contacts=contacts), robot
    )
    assert {joint for joint, _ in needs} == {hip}
    assert [least for _, least in needs] == pytest.approx([20.0 * first / 199.0 for first in (100, 104, 108)])
    assert weakened(robot, hip, 10.0).torque_limit[hip] == 10.0
    assert weakened(robot, hip, 99.0).torque_limit[hip] == robot.torque_limit[hip]


def _plant(way: float, *codes: str) -> Plant:
    return Plant(clip="clip", joint="Left_Hip_Roll", limit=10.0, moved=way, broken=frozenset(codes))


def test_only_plants_that_move_a_body_by_five_centimetres_are_held_to_the_bar():
    need, lasting = "reference_need_run_s", "reference_lasting_need"
    plants = [_plant(0.06, lasting), _plant(np.inf, need, "torque_ratio"), _plant(0.2), _plant(0.04)]
    bars = {bar.name.strip(): bar for bar in bars_of([Found(references=3, plants=plants, shy=[0.01, 0.07])])}
    assert bars["that matter: some body moved 5 cm"].value == 3
    assert bars["found, of those that matter"].value == pytest.approx(200.0 / 3.0)
    assert bars["found, of those that matter"].holds is False
    assert bars["found, of the others"].value == 0.0
    assert bars[f"by {need}"].value == bars[f"by {lasting}"].value == pytest.approx(100.0 / 3.0)
    assert bars["by anything but what references ask of the motors"].value == pytest.approx(100.0 / 3.0)
    assert bars["a limit of 0.98 of the most: some body moved 5 cm"].value == 50.0


def test_references_without_a_plant_that_matters_measure_nothing_and_hold_no_bar():
    bars = bars_of([Found(references=3, plants=[_plant(0.04)], shy=[0.01])])
    asked = [bar for bar in bars if bar.bound is not None]
    assert [bar.name for bar in asked] == ["found, of those that matter: not measured"]
    assert asked[0].holds is False
