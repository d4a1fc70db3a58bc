"""`booster-lab validate POLICY`: does a policy do in MuJoCo what is asked of it? The exit code is the verdict."""

from __future__ import annotations

import json
from pathlib import Path

from pipeline.batch.reporting_pool import ReportingPool
from pipeline.cli.policy_arguments import Validate
from pipeline.cli.project import Project, find_project
from pipeline.cli.text_table import text_table
from pipeline.deployment import Policy, digest, load_policy
from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.robot import load_robot
from pipeline.validation.deployed import deployed, with_ankle_kd
from pipeline.validation.failed_trials import refuse_foreign, remove_earlier, write_failed_trials
from pipeline.validation.measure import measure
from pipeline.validation.suites import cells_of
from pipeline.validation.verdict import as_text, judge, table

EXPORTED = "policy.npz"
"""The network in the folder of an exported policy (`pipeline.export.folder`)."""
FAILED = 3
"""Exit code of a policy that fails; 1 is of a validation that could not be done."""


def run(args: Validate) -> int:
    """Measure, judge, tell."""
    project = find_project()
    bars = project.validation(args.robot)
    folder = robot_folder(project, args.robot)
    one = deployed(folder, policy_of(args.policy, folder))
    if args.ankle_kd is not None:
        one = with_ankle_kd(one, args.ankle_kd)
    cells = cells_of(args.suite, one.robot)
    if args.failures:
        refuse_foreign(args.failures, cells, one)
    measured = measure(one, cells, ReportingPool(workers=args.workers, what="parts of the trials done"))
    verdict = judge(measured, bars, suite=args.suite, policy=digest(one.policy), robot=one.robot.digest)
    if args.table:
        rows = table(verdict)
        print(text_table(list(rows[0]), [list(row.values()) for row in rows]))
    damped = "" if args.ankle_kd is None else f", ankles damped with {args.ankle_kd:g} N m s/rad"
    print(f"{args.policy} on {folder}, suite {args.suite}{damped}")
    print(as_text(verdict))
    if args.json:
        record = {**verdict.to_dict(), "gains": one.gains()}
        atomic.write_text(args.json, json.dumps(record, indent=1, sort_keys=True, allow_nan=False) + "\n")
    if args.failures:
        logs = write_failed_trials(one, verdict, args.failures)
        gone = remove_earlier(args.failures, one, logs)
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
