"""`booster-lab cross-engine POLICY`: does a policy hold in another physics engine? The exit code is the verdict."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path

from pipeline.batch import ClipPool
from pipeline.cli.project import find_project
from pipeline.cli.text_table import text_table
from pipeline.cli.validate_command import policy_of, robot_folder
from pipeline.deployment import digest
from pipeline.errors import UnknownNameError
from pipeline.files import atomic
from pipeline.validation.cross_engine import NAMES, CrossEngineResult, cross_engine
from pipeline.validation.cross_engine_settings import CrossEngineSettings
from pipeline.validation.deployed import deployed, with_ankle_kd

FAILED = 3
"""Exit code of a policy that fails; 1 is of a comparison that could not be done."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "cross-engine",
        help="tell whether a policy holds in MuJoCo and DART",
        description="Walk a policy through the grid of data/cross_engine.yaml in MuJoCo, in MuJoCo with the armature "
        "on the links, and in DART, and hold it against the robot's validation.yaml. Exit code 0: passed, 3: failed, "
        "1: could not be done.",
    )
    parser.add_argument("policy", metavar="POLICY", type=Path, help="npz of a policy, or the folder of an exported one")
    parser.add_argument("--robot", metavar="NAME", default="t1", help="robot it is for, adapted where it was")
    parser.add_argument("--ankle-kd", metavar="KD", type=float, help="damping of the ankles [N m s/rad]")
    parser.add_argument("--cells", metavar="NAME", nargs="+", default=[], help="these cells alone")
    parser.add_argument("--seeds", metavar="N", type=int, help="starts of each cell, in place of the file's")
    parser.add_argument("--json", metavar="OUT", type=Path, help="write verdict and all figures here")
    parser.add_argument("--workers", metavar="N", type=int, default=0, help="processes; 0 for one each core")
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Walk, judge, tell."""
    project = find_project()
    grid = project.settings("cross_engine.yaml", CrossEngineSettings)
    bars = project.validation(parsed.robot)
    for name in parsed.cells:
        if name not in grid.cells:
            raise UnknownNameError("cell", name, tuple(grid.cells))
    if parsed.seeds is not None:
        grid = dataclasses.replace(grid, simulation=dataclasses.replace(grid.simulation, seeds=parsed.seeds))
    folder = robot_folder(project, parsed.robot)
    one = deployed(folder, policy_of(parsed.policy, folder))
    if parsed.ankle_kd is not None:
        one = with_ankle_kd(one, parsed.ankle_kd)
    found = cross_engine(one, grid, bars, pool=ClipPool(workers=parsed.workers), only=tuple(parsed.cells))
    print(text_table(["cell", "engine", "survival", "forward", "left", "turning", "height", "power [W]"], _rows(found)))
    print(f"{parsed.policy} on {folder}: {'passed' if found.passed else 'failed'}")
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
    if parsed.json:
        record = {"policy": digest(one.policy), "gains": one.gains(), **found.to_dict()}
        atomic.write_text(parsed.json, json.dumps(record, indent=1, sort_keys=True, allow_nan=False) + "\n")
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
