"""The K1 in what comes after its database: logs and their failures, DART, Webots, export."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.actuators.standing import read_standing_pose
from pipeline.dart.plant import DartPlant
from pipeline.deployment import deployment_task
from pipeline.export.folder import Source, export_policy, read_export
from pipeline.failures.find import find_failures
from pipeline.files import settings
from pipeline.robot import Robot, load_robot
from pipeline.robot.load import ROBOTS, read_description
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT
from pipeline.virtual_robot.trial import VirtualTrial
from pipeline.webots.project import write_project
from pipeline.webots.result import WebotsSettings
from pipeline.webots.validate import project_faults
from tests.factories.log_trials import FAILURES, nominal_actuators, scripted_log, trial_of
from tests.factories.networks import network_file


@pytest.fixture(scope="module")
def k1() -> Robot:
    return load_robot("k1")


@pytest.mark.parametrize(("script", "falls"), [(SWAY, 0), (TOPPLE_LEFT, 1)])
def test_a_log_of_22_motors_is_read_and_its_fall_is_found(k1: Robot, script, falls: int):
    trial = trial_of(scripted_log(k1, script, VirtualTrial(command=((0.0, 0.0, 0.0, 0.0),), seconds=5.0)), k1)
    assert (trial.robot, trial.joint_names) == ("k1", k1.joint_names)
    report = find_failures(trial, k1, nominal_actuators(k1), FAILURES)
    assert sum(each.kind == "fall" for each in report.failures) == falls


def test_it_stands_in_dart_as_in_its_makers_pose(k1: Robot):
    pose = read_standing_pose(ROBOTS / "k1", k1)
    assert pose is not None
    plant = DartPlant(k1)
    plant.reset()
    control = PdControl(kp=pose.kp, kd=pose.kd, envelope=TorqueEnvelope(limit=k1.torque_limit))
    for _ in range(400):
        state = plant.state()
        plant.step(control.torque(pose.joint_pos, state.joint_pos, state.joint_vel), None)
    state = plant.state()
    assert state.root_pos_w[2] == pytest.approx(0.55, abs=0.01)
    assert 2.0 * np.linalg.norm(state.root_quat_w[1:3]) < np.radians(3.0)


def test_its_webots_project_is_the_robot(tmp_path: Path, root: Path, k1: Robot):
    plan = settings.read(root / "data" / "webots.yaml", WebotsSettings)
    envelope = TorqueEnvelope(limit=k1.torque_limit)
    project = write_project(tmp_path, read_description(ROBOTS / "k1"), deployment_task(k1), envelope, None, plan)
    assert project_faults(project.world, k1) == ()


def test_its_policy_is_exported_for_the_makers_configuration(tmp_path: Path, k1: Robot):
    data = {"digest": "d" * 64, "licence": {"strictest": "attribution", "allowed_use": "Any use; name the sources."}}
    source = Source(policy=network_file(tmp_path / "trained.npz", k1), run={"name": "run1"}, data=data)
    export_policy(tmp_path / "out", "test", k1, source, np.random.default_rng(4), shippable=False)
    assert read_export(tmp_path / "out", k1).task.joint_names == k1.joint_names
    text = "".join(path.read_text() for path in (tmp_path / "out" / "booster_deploy").rglob("*.py"))
    assert "K1_CFG" in text and '"ALeft_Shoulder_Pitch"' in text
