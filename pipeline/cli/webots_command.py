"""`booster-lab webots-project`: the Webots project of a robot, and its walk in Webots or a stand-in."""

from pathlib import Path

from pipeline.cli.policy_arguments import WebotsProject
from pipeline.cli.policy_commands import FAILED, deployed_policy, robot_folder
from pipeline.deployment import deployment_task
from pipeline.errors import FileError
from pipeline.files.csv_json import write_json
from pipeline.project import find_project
from pipeline.robot import Robot, load_robot
from pipeline.robot.load import read_description
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.derived_bars import allowed_of
from pipeline.webots.launch import launch_webots
from pipeline.webots.project import Project, write_project
from pipeline.webots.result import Allowed, WebotsSettings
from pipeline.webots.validate import (
    LABELS,
    MUJOCO_STAND_IN,
    ODE_STAND_IN,
    WEBOTS,
    WebotsVerdict,
    project_faults,
    run_stand_in,
    verdict,
)

STAND_INS = {"mujoco": MUJOCO_STAND_IN, "ode": ODE_STAND_IN}


def run(args: WebotsProject) -> int:
    """Write and check; on request walk and evaluate."""
    checkout = find_project()
    settings = checkout.read("webots.yaml", WebotsSettings)
    folder = robot_folder(checkout, args.robot)
    project, robot = _write(args, folder, settings)
    faults = project_faults(project.world, robot)
    if faults:
        raise FileError(project.world, f"it is not the robot of {folder}: {'; '.join(faults)}.")
    print(f"{project.world}: {len(robot.joint_names)} motors, {robot.total_mass:.4f} kg")
    if args.engine is None:
        print(f"open it with: webots {project.world}")
        return 0
    rules = checkout.validation(args.robot)
    note = rules.reference.note_on(robot.digest)
    if note:
        print(f"note: {note}")
    found = _walk(args.engine, project, settings, allowed_of(rules.webots))
    print(f"{LABELS[found.engine]}: {found.status}")
    for reason in found.reasons:
        print(f"  {reason}")
    if args.json:
        write_json(args.json, {**found.to_dict(), "note": note or None})
    if found.failed_to_run:
        return 1
    return 0 if found.status == "passed" else FAILED


def _write(args: WebotsProject, folder: Path, settings: WebotsSettings) -> tuple[Project, Robot]:
    source = read_description(folder)
    if args.policy is None:
        robot = load_robot(folder)
        envelope = TorqueEnvelope(limit=robot.torque_limit)
        return write_project(args.out, source, deployment_task(robot), envelope, None, settings), robot
    one = deployed_policy(folder, args.policy, args.ankle_kd)
    return write_project(args.out, source, one.task, one.envelope, one.policy, settings), one.robot


def _walk(engine: str, project: Project, settings: WebotsSettings, allowed: dict[str, Allowed]) -> WebotsVerdict:
    if engine == "webots":
        return verdict(WEBOTS, launch_webots(project, settings), settings, allowed)
    return verdict(STAND_INS[engine], run_stand_in(engine, project, settings), settings, allowed)
