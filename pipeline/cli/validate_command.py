"""`booster-lab validate POLICY`: does a policy do in MuJoCo what is asked of it? The exit code is the verdict."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pipeline.batch import ClipPool
from pipeline.cli.project import Project, find_project
from pipeline.cli.text_table import text_table
from pipeline.deployment import Policy, digest, load_policy
from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.robot import load_robot
from pipeline.validation.deployed import deployed, with_ankle_kd
from pipeline.validation.earlier_logs import refuse_foreign, remove_earlier
from pipeline.validation.failed_trials import write_failed_trials
from pipeline.validation.measure import measure
from pipeline.validation.report import as_text, table
from pipeline.validation.suites import QUICK, SUITES, cells_of
from pipeline.validation.verdict import judge

EXPORTED = "policy.npz"
"""The network in the folder of an exported policy (`pipeline.export.folder`)."""
FAILED = 3
"""Exit code of a policy that fails; 1 is of a validation that could not be done."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "validate",
        help="tell whether a policy passes simulation",
        description="Walk a policy in MuJoCo through commands, pushes, terrain and conditions, and hold what it does "
        "against robots/<robot>/validation.yaml. Exit code 0: passed, 3: failed, 1: could not be done.",
    )
    parser.add_argument("policy", metavar="POLICY", type=Path, help="npz of a policy, or the folder of an exported one")
    parser.add_argument("--robot", metavar="NAME", default="t1", help="robot it is for, adapted where it was")
    parser.add_argument(
        "--ankle-kd",
        metavar="KD",
        type=float,
        help="damping of the ankles [N m s/rad], for a policy whose file doesn't say with which it is deployed",
    )
    parser.add_argument("--suite", choices=SUITES, default=QUICK, help="how much is tried")
    parser.add_argument("--json", metavar="OUT", type=Path, help="write verdict and all numbers here")
    parser.add_argument(
        "--failures",
        metavar="FOLDER",
        type=Path,
        help="write a log of each failed cell's worst trial here; those of an earlier verdict of this policy go",
    )
    parser.add_argument("--workers", metavar="N", type=int, default=0, help="processes; 0 for one each core")
    parser.add_argument("--table", action="store_true", help="print every cell")
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Measure, judge, tell."""
    project = find_project()
    bars = project.validation(parsed.robot)
    folder = robot_folder(project, parsed.robot)
    one = deployed(folder, policy_of(parsed.policy, folder))
    if parsed.ankle_kd is not None:
        one = with_ankle_kd(one, parsed.ankle_kd)
    cells = cells_of(parsed.suite, one.robot)
    if parsed.failures:
        refuse_foreign(parsed.failures, cells, one)
    measured = measure(one, cells, ClipPool(workers=parsed.workers))
    verdict = judge(measured, bars, suite=parsed.suite, policy=digest(one.policy), robot=one.robot.digest)
    if parsed.table:
        rows = table(verdict)
        print(text_table(list(rows[0]), [list(row.values()) for row in rows]))
    damped = "" if parsed.ankle_kd is None else f", ankles damped with {parsed.ankle_kd:g} N m s/rad"
    print(f"{parsed.policy} on {folder}, suite {parsed.suite}{damped}")
    print(as_text(verdict))
    if parsed.json:
        record = {**verdict.to_dict(), "gains": one.gains()}
        atomic.write_text(parsed.json, json.dumps(record, indent=1, sort_keys=True, allow_nan=False) + "\n")
    if parsed.failures:
        logs = write_failed_trials(one, verdict, parsed.failures)
        gone = remove_earlier(parsed.failures, one, logs)
        for path in logs:
            print(f"written: {path}")
        for path in gone:
            print(f"removed, of an earlier verdict: {path}")
    return 0 if verdict.passed else FAILED


def robot_folder(project: Project, name: str) -> Path:
    """The adapted robot's folder, or the robot's own where it was never adapted. Raises UnknownNameError."""
    project.robot(name)
    adapted = project.root / "data" / "adapted_robot" / name
    return adapted if (adapted / "robot.toml").is_file() else project.root / "robots" / name


def policy_of(path: Path, robot: Path) -> Policy:
    """The policy of an npz or of an exported policy's folder. Raises FileError."""
    if path.is_dir():
        if not (path / EXPORTED).is_file():
            raise FileError(path, f"it has no {EXPORTED}.", "Name an npz, or the folder of an exported policy.")
        from pipeline.export.folder import read_export  # brings PyTorch

        return read_export(path, load_robot(robot)).policy
    if path.suffix != ".npz":
        raise FileError(path, "it is no npz.", "Name an npz, or the folder of an exported policy.")
    return load_policy(path)
