"""`booster-lab cross-engine POLICY`: does a policy hold in another physics engine? The exit code is the verdict."""

from __future__ import annotations

import dataclasses
import json

from pipeline.batch.reporting_pool import ReportingPool
from pipeline.cli.policy_arguments import CrossEngine
from pipeline.cli.project import find_project
from pipeline.cli.text_table import text_table
from pipeline.cli.validate_command import policy_of, robot_folder
from pipeline.deployment import digest
from pipeline.errors import UnknownNameError
from pipeline.files import atomic
from pipeline.validation.cross_engine import NAMES, CrossEngineResult, cross_engine
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.deployed import deployed, with_ankle_kd

FAILED = 3
"""Exit code of a policy that fails; 1 is of a comparison that could not be done."""


def run(args: CrossEngine) -> int:
    """Walk, judge, tell."""
    project = find_project()
    grid = project.settings("cross_engine.yaml", CrossEngineSettings)
    bars = project.validation(args.robot)
    for name in args.cells:
        if name not in grid.cells:
            raise UnknownNameError("cell", name, tuple(grid.cells))
    if args.seeds is not None:
        grid = dataclasses.replace(grid, simulation=dataclasses.replace(grid.simulation, seeds=args.seeds))
    folder = robot_folder(project, args.robot)
    one = deployed(folder, policy_of(args.policy, folder))
    if args.ankle_kd is not None:
        one = with_ankle_kd(one, args.ankle_kd)
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
        record = {"policy": digest(one.policy), "gains": one.gains(), **found.to_dict()}
        atomic.write_text(args.json, json.dumps(record, indent=1, sort_keys=True, allow_nan=False) + "\n")
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
