"""A sound trial that every test changes in one respect."""

import pytest

from pipeline.failures.signals import signals_of
from pipeline.virtual_robot.scripted import SWAY
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import nominal_actuators, scripted_log, trial_of


@pytest.fixture(scope="session")
def standing(robot):
    """The T1 stands and sways for 6 s, told to stand."""
    trial = VirtualTrial(command=((0.5, 0.0, 0.0, 0.0),), seconds=6.0)
    return trial_of(scripted_log(robot, SWAY, trial), robot, "standing")


@pytest.fixture(scope="session")
def signals(standing, robot):
    return signals_of(standing, robot)


@pytest.fixture(scope="session")
def actuators(robot):
    return nominal_actuators(robot)
