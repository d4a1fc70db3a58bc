"""`booster-lab webots-project`: the Webots project of a robot, and its walk in Webots or what stands in for it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pipeline.cli.project import find_project
from pipeline.cli.validate_command import policy_of, robot_folder
from pipeline.deployment import deployment_task
from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.robot import Robot, load_robot
from pipeline.robot.load import read_description
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.deployed import deployed, with_ankle_kd
from pipeline.validation.derived_bars import allowed_of
from pipeline.webots.checks import project_faults
from pipeline.webots.launch import launch_webots
from pipeline.webots.project import Project, write_project
from pipeline.webots.settings import Allowed, WebotsSettings
from pipeline.webots.validate import LABELS, MUJOCO_STAND_IN, ODE_STAND_IN, WEBOTS, run_stand_in, verdict

FAILED = 3
"""Exit code of a walk that fails or was not run; 1 is of one that could not be done."""
STAND_INS = {"mujoco": MUJOCO_STAND_IN, "ode": ODE_STAND_IN}


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "webots-project",
        help="write a Webots project of a robot, and run it",
        description="Write PROTO, world and controller into a folder that Webots opens. With --run the walk of "
        "data/webots.yaml is walked and judged. Exit code 0: written, or passed; 3: failed, or not run as "
        "the program is missing; 1: could not be done.",
    )
    parser.add_argument("--robot", metavar="NAME", default="t1", help="robot, adapted where it was")
    parser.add_argument("--out", metavar="FOLDER", type=Path, required=True, help="folder of the project")
    parser.add_argument("--policy", metavar="POLICY", type=Path, help="npz of a policy or folder of an exported one")
    parser.add_argument("--ankle-kd", metavar="KD", type=float, help="damping of the ankles [N m s/rad]")
    parser.add_argument("--run", dest="engine", choices=("webots", *STAND_INS), help="walk it there as well")
    parser.add_argument("--json", metavar="OUT", type=Path, help="write what came of the walk here")
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Write, check, and where it is asked for walk and judge."""
    checkout = find_project()
    settings = checkout.settings("webots.yaml", WebotsSettings)
    folder = robot_folder(checkout, parsed.robot)
    project, robot = _write(parsed, folder, settings)
    faults = project_faults(project.world, robot)
    if faults:
        raise FileError(project.world, f"it is not the robot of {folder}: {'; '.join(faults)}.")
    print(f"{project.world}: {len(robot.joint_names)} motors, {robot.total_mass:.4f} kg")
    if parsed.engine is None:
        print(f"open it with: webots {project.world}")
        return 0
    rules = checkout.validation(parsed.robot)
    note = rules.reference.note_on(robot.digest)
    if note:
        print(f"note: {note}")
    return _walk(parsed, project, settings, allowed_of(rules.webots), note)


def _write(parsed: argparse.Namespace, folder: Path, settings: WebotsSettings) -> tuple[Project, Robot]:
    source = read_description(folder)
    if parsed.policy is None:
        robot = load_robot(folder)
        envelope = TorqueEnvelope(limit=robot.torque_limit)
        return write_project(parsed.out, source, deployment_task(robot), envelope, None, settings), robot
    one = deployed(folder, policy_of(parsed.policy, folder))
    if parsed.ankle_kd is not None:
        one = with_ankle_kd(one, parsed.ankle_kd)
    return write_project(parsed.out, source, one.task, one.envelope, one.policy, settings), one.robot


def _walk(
    parsed: argparse.Namespace, project: Project, settings: WebotsSettings, allowed: dict[str, Allowed], note: str
) -> int:
    if parsed.engine == "webots":
        found = verdict(WEBOTS, launch_webots(project, settings), settings, allowed)
    else:
        outcome = run_stand_in(parsed.engine, project, settings)
        found = verdict(STAND_INS[parsed.engine], outcome, settings, allowed)
    print(f"{LABELS[found.engine]}: {found.status}")
    for reason in found.reasons:
        print(f"  {reason}")
    if parsed.json:
        record = {**found.to_dict(), "note": note or None}
        atomic.write_text(parsed.json, json.dumps(record, indent=1, sort_keys=True, allow_nan=False) + "\n")
    if found.failed_to_run:
        return 1
    return 0 if found.status == "passed" else FAILED
