"""The robot that these tests use."""

import pytest

from pipeline.robot import Robot, load_robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot("t1")
