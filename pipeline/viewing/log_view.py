"""A robot's log for display: its pose in space, its commands and failures, and the same command in simulation.

A log has joint positions and the trunk's attitude. The path comes from leg odometry and is only valid while a sole is
on the ground.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.actuators.adapted_robot import TABLE, JointActuator, adapt, read_actuators
from pipeline.actuators.settings import ActuatorSettings
from pipeline.clips.robot_clip import RobotClip
from pipeline.deployment import Policy, find_policy, load_policy
from pipeline.errors import FileError
from pipeline.failures.find import find_failures
from pipeline.failures.settings import FailureSettings
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.sim_to_real import simulated
from pipeline.files.shown_text import markdown_list, markdown_table
from pipeline.hardware_logs import LogSettings, Trial, read_log
from pipeline.project import Project
from pipeline.readers.robot_log import root_poses
from pipeline.readers.robot_motion import robots
from pipeline.robot import Robot
from pipeline.viewing.playlist import Playlist, Shown

RATE_HZ = 50.0
SIMULATION = "simulation"


def log_playlist(path: Path, project: Project) -> Playlist:
    """The trials of a log, each with its simulation if the policy is available. Raises FileError for a refused log."""
    values = project.read("hardware_logs.yaml", LogSettings)
    trials = {trial.name: trial for trial in read_log(path, robots(), values)}
    if not trials:
        raise FileError(path, "it has no trial: joints and attitude were not recorded.")
    return Playlist(names=tuple(trials), load=lambda name: shown_trial(trials[name], project))


def shown_trial(trial: Trial, project: Project) -> Shown:
    """A trial for display. Raises FileError for another robot's trial."""
    if trial.robot not in project.robots:
        problem = f"its robot '{trial.robot}' is not in this project."
        raise FileError(trial.name, problem, "Add its folder to robots/.")
    robot = project.robot(trial.robot)
    actuators = _actuators(project, robot)
    report = find_failures(trial, robot, actuators, project.read("failures.yaml", FailureSettings))
    path = find_policy(project.policy_files(trial.robot), trial.policy_digest or "")
    policy = load_policy(path) if path else None
    twin = None
    if policy is not None and np.isfinite(np.asarray(trial.command, dtype=float)).any():
        twin = simulated(trial, robot, actuators, policy, trial.seconds).clip(SIMULATION)
    marks = {
        f"{each.time_s:.2f} s {each.kind.replace('_', ' ')} {each.joint or each.direction}": each.time_s
        for each in report.failures
    }
    return Shown(
        name=trial.name,
        robot=robot,
        robot_clip=pose_clip(trial, robot),
        reference=twin,
        reference_name=SIMULATION,
        text=_text(trial, report, policy),
        marks=marks,
        line_at=lambda time_s: _command_line(trial, time_s),
    )


def pose_clip(trial: Trial, robot: Robot) -> RobotClip:
    """The robot's pose at about `RATE_HZ`; missing frames are NaN and not drawn."""
    step = max(round(trial.rate_hz / RATE_HZ), 1)
    joint_pos = np.asarray(trial.joint_pos[::step], dtype=float)
    rpy = np.asarray(trial.rpy[::step], dtype=float)
    known = np.isfinite(joint_pos).all(axis=1) & np.isfinite(rpy).all(axis=1) & trial.measured[::step]
    frames = np.flatnonzero(known)
    if not len(frames):
        raise FileError(trial.name, "joints and attitude were never recorded together.")
    root_pos, root_quat = np.full((len(known), 3), np.nan), np.full((len(known), 4), np.nan)
    root_pos[frames], root_quat[frames] = root_poses(robot, rpy[frames], joint_pos[frames])
    joint_pos = np.where(known[:, None], joint_pos, np.nan)
    return robot.clip(trial.name, trial.rate_hz / step, root_pos, root_quat, joint_pos)


def _actuators(project: Project, robot: Robot) -> Sequence[JointActuator]:
    """The calibrated actuators of the adapted robot, else those of the nominal robot."""
    adapted = project.adapted_robot(robot.name)
    if (adapted / TABLE).is_file():
        return read_actuators(adapted)
    return adapt(robot, (), project.read("actuators.yaml", ActuatorSettings))


def _command_line(trial: Trial, time_s: float) -> str:
    row = min(max(round(time_s * trial.rate_hz), 0), len(trial.command) - 1)
    forward, lateral, yaw = np.asarray(trial.command[row], dtype=float)
    if not np.isfinite([forward, lateral, yaw]).all():
        return "command not recorded"
    return f"command {forward:.2f} m/s, {lateral:.2f} m/s, {yaw:.2f} rad/s"


def _text(trial: Trial, report: TrialReport, policy: Policy | None) -> str:
    facts = {
        "robot": trial.robot,
        "length": f"{trial.seconds:.1f} s at {trial.rate_hz:g} Hz",
        "policy": (trial.policy_digest or "not named")[:12] + ("" if policy else ", not available: no simulation"),
        "recorded": "in simulation" if trial.simulated else "on the robot",
    }
    failures = markdown_list((each.text() for each in report.failures), "no failure was found")
    return f"{markdown_table(('', ''), facts.items())}\n\n{failures}"
