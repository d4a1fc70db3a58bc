"""Command labels of frames against walks of known velocity, and the robot's facts against the tables they are of."""

import csv
import dataclasses

import numpy as np
import pytest

from pipeline import rotation
from pipeline.actuators.adapted_robot import TABLE, adapt, write_adapted_robot
from pipeline.actuators.settings import ActuatorSettings
from pipeline.expert.read import DatabaseClip
from pipeline.expert.training_bundle import frame_commands, robot_facts
from pipeline.files import settings
from pipeline.robot import mujoco_model

FPS = 50.0


def labels(velocity: np.ndarray, rate: np.ndarray, yaw: float = 0.0) -> np.ndarray:
    """Labels of a walk with velocities (t, 2) in its heading [m/s] and a yaw rate (t,) [rad/s]."""
    heading = yaw + np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0)]) / FPS
    x, y = velocity.T
    velocity_w = np.stack(
        [np.cos(heading) * x - np.sin(heading) * y, np.sin(heading) * x + np.cos(heading) * y], axis=1
    )
    way = np.concatenate([np.zeros((1, 2)), np.cumsum((velocity_w[1:] + velocity_w[:-1]) / 2.0, axis=0)]) / FPS
    frames = np.zeros((len(rate), 79))
    frames[:, :2], frames[:, 2], frames[:, 3:7] = way, 0.7, rotation.about_z(heading)
    return frame_commands(DatabaseClip(name="walk", weight=1.0, skill="walk", loop_mode="Clamp", frames=frames))


@pytest.mark.parametrize("yaw", [0.0, 2.0, -1.2])
@pytest.mark.parametrize(
    "command", [(0.5, 0.0, 0.0), (0.3, 0.4, 0.0), (0.0, -0.4, 0.0), (0.6, 0.2, 1.5), (0.0, 0.0, -1.5)]
)
def test_a_steady_walk_is_labelled_with_its_velocity_in_its_heading(command: tuple[float, float, float], yaw: float):
    count = 400  # at 1.5 rad/s nearly two turns: the heading passes pi
    found = labels(np.tile(command[:2], (count, 1)), np.full(count, command[2]), yaw)
    np.testing.assert_allclose(found, np.tile(command, (count, 1)), atol=2e-3)


def test_the_sway_of_strides_is_no_command():
    """Two strides a second: a mean over a second has nothing of them, one over a fifth has most."""
    time_s = np.arange(300) / FPS
    sway = 0.3 * np.sin(4.0 * np.pi * time_s)
    found = labels(np.stack([0.6 + sway, sway], axis=1), sway)
    np.testing.assert_allclose(found[30:-30], np.tile([0.6, 0.0, 0.0], (240, 1)), atol=0.02)


def test_a_robot_that_creeps_on_every_axis_is_told_to_stand_and_one_that_turns_is_not():
    slow = np.tile([0.1, -0.1], (200, 1))
    np.testing.assert_array_equal(labels(slow, np.full(200, 0.1)), 0.0)
    np.testing.assert_allclose(labels(slow, np.full(200, 0.5))[:, 2], 0.5, atol=1e-6)


def test_the_motors_of_a_bundle_are_those_of_the_table_of_actuators(tmp_path, root, robot):
    """Limits that a measurement changed: the table's columns by their names, in the robot's order."""
    actuators = adapt(robot, [], settings.read(root / "data" / "actuators.yaml", ActuatorSettings))
    measured = [
        dataclasses.replace(
            each,
            box_effort_limit=0.9 * each.box_effort_limit,
            box_velocity_limit=0.8 * each.box_velocity_limit,
            dc_motor_effort_limit=0.9 * each.box_effort_limit,
            dc_motor_saturation_effort=4.5 * each.box_effort_limit,
            dc_motor_no_load_speed=1.0 * each.box_velocity_limit,
        )
        if place % 2
        else each
        for place, each in enumerate(actuators)
    ]
    folder = tmp_path / robot.name
    adapted = write_adapted_robot(folder, root / "robots" / robot.name, measured)
    facts = robot_facts(adapted, folder)
    with (folder / TABLE).open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["joint"] for row in rows] == list(facts["joint_names"])
    columns = {
        "effort_limit": "box_effort_limit",
        "saturation_effort": "dc_motor_saturation_effort",
        "no_load_speed": "dc_motor_no_load_speed",
        "kp": "kp",
        "kd": "kd",
    }
    for fact, column in columns.items():
        stated = [float(row[column]) if row[column] else None for row in rows]
        assert facts[fact] == pytest.approx(stated), fact
    assert facts["no_load_speed"].count(None) == len(rows) - len(rows) // 2
    assert facts["weight"] == pytest.approx(mujoco_model(robot).body_mass.sum() * 9.81, rel=1e-4)
