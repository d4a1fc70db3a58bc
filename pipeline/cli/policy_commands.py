"""`booster-lab validate`, `cross-engine` and `play`: a policy in MuJoCo and in other physics engines.

The exit code of the first two is the verdict. `play` shows an interactive walk in the browser, or writes a film.
"""

import contextlib
import dataclasses
from collections.abc import Iterator
from pathlib import Path

from pipeline.batch.reporting_pool import ReportingPool
from pipeline.cli.policy_arguments import CrossEngine, Play, Validate
from pipeline.cli.text_table import text_table
from pipeline.deployment import Policy, digest, load_policy
from pipeline.deployment.controller import PolicyMisfitError
from pipeline.deployment.task import PolicyJointsError
from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.files.csv_json import write_json
from pipeline.project import Project, find_project
from pipeline.robot import load_robot
from pipeline.validation.cross_engine import NAMES, CrossEngineResult, cross_engine
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd
from pipeline.validation.failed_trials import refuse_foreign, remove_earlier, write_failed_trials
from pipeline.validation.figures import measure
from pipeline.validation.suites import FULL, HELD_OUT, cells_of
from pipeline.validation.verdict import as_text, judge, table

EXPORTED = "policy.npz"
"""The network in the folder of an exported policy (`pipeline.export.folder`)."""
FAILED = 3
"""Exit code for a policy that fails; 1 means that the command could not run."""


def validate_policy(args: Validate) -> int:
    """Validate a policy and print the verdict. Returns the exit code."""
    if args.failures and args.suite == HELD_OUT:
        raise PipelineError("logs of held-out trials must not influence the next database. Leave out --failures.")
    project = find_project()
    folder = robot_folder(project, args.robot)
    bars = project.validation(args.robot)
    one = deployed_policy(folder, args.policy, args.ankle_kd)
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
        write_json(args.json, {**verdict.to_dict(), "gains": one.gains()})
    if args.failures:
        logs = write_failed_trials(one, verdict, args.failures)
        gone = remove_earlier(args.failures, one, logs, None if args.suite == FULL else cells)
        for path in logs:
            print(f"written: {path}")
        for path in gone:
            print(f"removed (from an earlier verdict): {path}")
    return 0 if verdict.passed else FAILED


def robot_folder(project: Project, name: str) -> Path:
    """Folder of the adapted robot, else of the nominal robot. Raises UnknownNameError."""
    project.robot(name)
    adapted = project.adapted_robot(name)
    return adapted if (adapted / "robot.toml").is_file() else project.robot_folder(name)


def deployed_policy(robot: Path, policy: Path, ankle_kd: float | None) -> Deployed:
    """A policy on the robot of a folder, with an optional other ankle damping `ankle_kd` [N m s/rad]."""
    with naming_policy(policy):
        one = deployed(robot, policy_of(policy, robot))
    return one if ankle_kd is None else with_ankle_kd(one, ankle_kd)


@contextlib.contextmanager
def naming_policy(policy: Path) -> Iterator[None]:
    """Raise a FileError with the policy's file if it does not fit the robot."""
    try:
        yield
    except PolicyJointsError as error:
        raise FileError(policy, str(error)) from error
    except PolicyMisfitError as error:
        do = "Name a walking policy, and its robot with --robot."
        raise FileError(policy, f"it does not fit the robot: {error}", do) from error


def policy_of(path: Path, robot: Path) -> Policy:
    """Load a policy from an npz or the folder of an exported policy. Raises FileError."""
    if not path.exists():
        raise FileError(path, "there is no such file or folder.", "Name an npz, or the folder of an exported policy.")
    if path.is_dir():
        if not (path / EXPORTED).is_file():
            raise FileError(path, f"it has no {EXPORTED}.", "Name an npz, or the folder of an exported policy.")
        from pipeline.export.folder import read_export  # imports PyTorch

        return read_export(path, load_robot(robot)).policy
    if path.suffix != ".npz":
        raise FileError(path, "it is not an npz file.", "Name an npz, or the folder of an exported policy.")
    return load_policy(path)


def compare_engines(args: CrossEngine) -> int:
    """Compare a policy in several engines and print the verdict. Returns the exit code."""
    project = find_project()
    grid = project.read("cross_engine.yaml", CrossEngineSettings)
    folder = robot_folder(project, args.robot)
    bars = project.validation(args.robot)
    for name in args.cells:
        if name not in grid.cells:
            raise UnknownNameError("cell", name, tuple(grid.cells))
    if args.seeds is not None:
        grid = dataclasses.replace(grid, simulation=dataclasses.replace(grid.simulation, seeds=args.seeds))
    one = deployed_policy(folder, args.policy, args.ankle_kd)
    found = cross_engine(
        one, grid, bars, pool=ReportingPool(workers=args.workers, what="walks done"), only=tuple(args.cells)
    )
    print(text_table(["cell", "engine", "survival", "forward", "left", "turning", "height", "power [W]"], _rows(found)))
    print(f"{args.policy} on {folder}: {'passed' if found.passed else 'failed'}")
    for reason in found.reasons:
        print(f"  {reason}")
    for text in (text for cell in found.cells if cell.required for text in cell.explained):
        print(f"  explained by the armature on the links: {text}")
    for name, why in found.not_required.items():
        print(f"  not required  {name}: {why}")
    if found.note:
        print(f"  note  {found.note}")
    required = len(found.cells) - len(found.not_required)
    failed = f"{len(found.failed_cells)} of {required} required cells failed"
    print(failed if required else "no cell is required: nothing was shown")
    if args.json:
        write_json(args.json, {"policy": digest(one.policy), "gains": one.gains(), **found.to_dict()})
    return 0 if found.passed else FAILED


def _rows(found: CrossEngineResult) -> list[list[str]]:
    figures = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "height_m")
    return [
        [
            cell.name if cell.required else f"({cell.name})",
            NAMES[engine],
            f"{cell.survival(engine):.1f}",
            *(f"{cell.mean(engine, name):.3f}" for name in figures),
            f"{cell.mean(engine, 'power_w'):.0f}",
        ]
        for cell in found.cells
        for engine in cell.figures
    ]


def play(args: Play) -> int:
    """Show the interactive page until interrupted, or write a film."""
    from pipeline.viewing.film import Walk, record_walk
    from pipeline.viewing.play_page import PlayPage

    one = deployed_policy(robot_folder(find_project(), args.robot), args.policy, args.ankle_kd)
    if args.record is not None:
        walk = Walk(
            command=args.command, seconds=args.seconds, push=args.push, terrain=args.terrain, friction=args.friction
        )
        print(record_walk(args.record, one, walk))
        return 0
    PlayPage(one, args.policy.name, port=args.port).serve(str(args.policy), browser=not args.no_browser)
    return 0
