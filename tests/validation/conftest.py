"""The grid of walks in two engines, its bars, and who walks it: a policy that does nothing, and the published one."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.deployment import deployment_task, load_policy
from pipeline.files.settings import read
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import ValidationSettings, read_validation
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.deployed import Deployed, with_ankle_kd
from tests.factories.policies import still_policy


@pytest.fixture(scope="module")
def settings(root: Path) -> CrossEngineSettings:
    return read(root / "data" / "cross_engine.yaml", CrossEngineSettings)


@pytest.fixture(scope="module")
def rules(root: Path) -> ValidationSettings:
    return read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")


@pytest.fixture(scope="session")
def still(robot: Robot) -> Deployed:
    """A policy that does nothing."""
    task = deployment_task(robot)
    return Deployed(
        robot=robot, task=task, policy=still_policy(task), envelope=TorqueEnvelope(limit=robot.torque_limit)
    )


@pytest.fixture
def published(robot: Robot, policies: Path) -> Deployed:
    """The published policy with the gains that it is deployed with."""
    policy = load_policy(policies / "t1_walk.npz")
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    return with_ankle_kd(Deployed(robot=robot, task=deployment_task(robot), policy=policy, envelope=envelope), 2.0)
