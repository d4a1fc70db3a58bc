"""The robots that every test of a robot runs on: those of the project, and the small one made for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.robot import Robot, load_robot
from pipeline.robot.load import robot_names
from tests.factories.robot_folder import write_small_robot


@pytest.fixture(scope="session", params=[*robot_names(), "small"])
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Each robot of `robots/`, and the small one."""
    if request.param == "small":
        return load_robot(write_small_robot(tmp_path_factory.mktemp("robots") / "small"))
    return load_robot(request.param)


@pytest.fixture
def t1() -> Robot:
    return load_robot("t1")


@pytest.fixture
def t1_folder(root: Path) -> Path:
    return root / "robots" / "t1"


@pytest.fixture
def poses(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """100 random poses within the limits: root position [m], root orientation (wxyz), joint positions [rad]."""
    rng = np.random.default_rng(20)
    joints = rng.uniform(robot.joint_lower, robot.joint_upper, (100, len(robot.joint_names)))
    return rng.normal(size=(100, 3)), rotation.normalize(rng.normal(size=(100, 4))), joints
