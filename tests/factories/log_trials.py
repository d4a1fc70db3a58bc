"""Logs of virtual robots as the trials that the reader makes of them, and what they are looked at with."""

from __future__ import annotations

import tempfile
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.actuators.adapted_robot import JointActuator, adapt
from pipeline.actuators.settings import ActuatorSettings
from pipeline.actuators.standing import read_standing_pose
from pipeline.deployment import deployment_task
from pipeline.failures.settings import FailureSettings
from pipeline.files import settings
from pipeline.hardware_logs import LogFacts, LogSettings, RobotLog, Trial, ingest, layouts, read_trial, write_mcap
from pipeline.hardware_logs.trial import ARRAYS, TrialWriter
from pipeline.robot import Robot
from pipeline.virtual_robot.scripted import Script, ScriptedController
from pipeline.virtual_robot.trial import VirtualTrial, simulate

ROOT = Path(__file__).resolve().parents[2]
FAILURES = settings.read(ROOT / "data/failures.yaml", FailureSettings)
LOGS = settings.read(ROOT / "data/hardware_logs.yaml", LogSettings)


def trial_of(log: RobotLog, robot: Robot, name: str = "trial") -> Trial:
    """The one trial in a log, written as MCAP and read back."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.mcap"
        write_mcap(path, log)
        (trial,) = trials_in(path, robot)
        return trial


def trials_in(path: Path, robot: Robot) -> list[Trial]:
    """The trials of a log file."""
    with tempfile.TemporaryDirectory() as folder:
        made = ingest(path, path.stem, Path(folder), layouts=layouts([robot]), settings=LOGS).trials
        return [read_trial(each.path) for each in made]


def nominal_actuators(robot: Robot) -> tuple[JointActuator, ...]:
    """The robot's own motor limits."""
    return adapt(robot, [], settings.read(ROOT / "data/actuators.yaml", ActuatorSettings))


def scripted_log(robot: Robot, script: Script, trial: VirtualTrial, seed: int = 0) -> RobotLog:
    """The log of a script, which stands in the manufacturer's standing pose."""
    pose = read_standing_pose(ROOT / "robots" / robot.name, robot)
    assert pose is not None
    task = deployment_task(robot, kp=pose.kp, kd=pose.kd, default_joint_pos=pose.joint_pos)
    facts = LogFacts(robot=robot.name, policy_digest=script.digest)
    return simulate(robot, ScriptedController(task, script), trial, np.random.default_rng(seed), facts)[1]


def head_of(trial: Trial) -> dict[str, Any]:
    """What a trial is besides its arrays, as JSON."""
    head = {each.name: getattr(trial, each.name) for each in fields(trial) if each.name not in ARRAYS}
    head["events"] = [vars(event) for event in trial.events]
    head["gaps"] = [vars(gap) for gap in trial.gaps]
    missed = [asdict(each) for each in head.pop("missed")]
    return {**head, "missed": missed} if missed else head


def write_trial(path: Path, trial: Trial) -> None:
    """Write a trial's Parquet file, whole or not at all. Same trial, same bytes."""
    with TrialWriter(path) as writer:
        writer.add({name: getattr(trial, name) for name in ARRAYS})
        writer.finish(head_of(trial))
