"""A project of the T1 that stands, with a short walk to be judged."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import pytest

from pipeline.actuators.standing import read_standing_pose
from pipeline.deployment import deployment_task
from pipeline.robot import Robot
from pipeline.robot.load import read_description
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.webots.project import Project, write_project
from pipeline.webots.result import WalkSegment, WebotsSettings


@pytest.fixture(scope="session")
def short_walk() -> WebotsSettings:
    """Two segments of standing; the program has a minute."""
    still = (0.0, 0.0, 0.0)
    segments = tuple(WalkSegment(name=name, seconds=0.6, command=still) for name in ("first", "second"))
    return WebotsSettings(timestep_ms=5.0, friction=1.0, measured_s=0.4, limit_s=60.0, segments=segments)


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory, root: Path, robot: Robot, short_walk: WebotsSettings) -> Project:
    """Without a policy: the robot stands in its default pose with the manufacturer's standing gains."""
    folder = root / "robots" / "t1"
    pose = read_standing_pose(folder, robot)
    assert pose is not None
    task = deployment_task(robot, kp=pose.kp, kd=pose.kd)
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    where = tmp_path_factory.mktemp("webots") / "project"
    return write_project(where, read_description(folder), task, envelope, None, short_walk)


@pytest.fixture
def project(tmp_path: Path, template: Project) -> Project:
    """A copy of the template, to be changed at will."""
    shutil.copytree(template.folder, tmp_path / "project")
    return dataclasses.replace(template, folder=tmp_path / "project")
