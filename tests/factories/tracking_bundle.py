"""A small tracking bundle: the nominal T1 as its own adapted robot, two short clips; and an untrained tracker."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.actuators.adapted_robot import adapt, write_adapted_robot
from pipeline.actuators.settings import ActuatorSettings
from pipeline.expert.training_bundle import robot_facts
from pipeline.files import settings
from pipeline.robot import Robot
from pipeline.tracking.task import ACTION_SCALE, OBSERVATION, observation_size
from pipeline.tracking.write_bundle import write_tracking_bundle
from tests.factories.robot_clips import standing


def tracking_bundle(folder: Path, root: Path, robot: Robot) -> Path:
    """A bundle of two standing clips of different lengths."""
    actuators = adapt(robot, [], settings.read(root / "data" / "actuators.yaml", ActuatorSettings))
    write_adapted_robot(folder / "robot", root / "robots" / robot.name, actuators)
    clips = [standing(robot, seconds=2.0, name="test/a"), standing(robot, seconds=1.0, name="test/b")]
    write_tracking_bundle(folder / "bundle", clips, robot, robot_facts(robot, folder / "robot"), ["CC0-1.0"])
    return folder / "bundle"


def tracker_file(path: Path, robot: Robot, /, **changed: np.ndarray) -> Path:
    """A tracker whose action is zero: its joint targets are the reference's joints."""
    inputs, outputs = observation_size(len(robot.joint_names), len(robot.key_links), len(robot.controlled)), 21
    arrays = {
        "mean": np.zeros(inputs),
        "std": np.ones(inputs),
        "eps": np.array(0.01),
        "L0_w": np.zeros((8, inputs)),
        "L0_b": np.zeros(8),
        "L1_w": np.zeros((outputs, 8)),
        "L1_b": np.zeros(outputs),
        "kp": robot.kp,
        "kd": robot.kd,
        "default_joint_pos": robot.default_joint_pos,
        "joint_names": np.array(robot.joint_names),
        "robot": np.array(robot.name),
        "controlled": np.array(robot.controlled),
        "key_links": np.array(robot.key_links),
        "action_scale": np.array(ACTION_SCALE),
        "observation": np.array(OBSERVATION),
    }
    np.savez(path, **{**arrays, **changed})  # pyright: ignore[reportArgumentType]
    return path
