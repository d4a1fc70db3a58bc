"""Derive the bars from a reference policy: `python -m pipeline.validation.derive POLICY.npz [--robot FOLDER]`.

Run the rollouts of each verdict with each ankle damping of the robot's `validation.yaml` (the policy's own gains where
it has none), and write the bars: the worst figure of all trials plus its margin. Bars of other parts are kept.
"""

import argparse
import dataclasses
import itertools
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from pipeline.batch import ClipPool
from pipeline.deployment import digest as policy_digest
from pipeline.deployment import load_policy
from pipeline.errors import FileError, PipelineError
from pipeline.files import atomic, settings
from pipeline.robot.legs import legs_of
from pipeline.robot.load import read_description
from pipeline.validation.bars import (
    CellBars,
    Reference,
    RobotBars,
    ValidationRules,
    ValidationSettings,
    derived,
    scaled_to,
)
from pipeline.validation.cross_engine import cross_engine
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd
from pipeline.validation.derived_bars import engine_bars, limit_cycle_bars, webots_bars
from pipeline.validation.figures import measure
from pipeline.validation.limit_cycle_walks import limit_cycles
from pipeline.validation.limit_cycles import LimitCycleSettings
from pipeline.validation.suites import full
from pipeline.webots.launch import NOT_RUN
from pipeline.webots.project import write_project
from pipeline.webots.result import WalkResult, WebotsSettings
from pipeline.webots.validate import run_stand_in

RULES = Path("data/validation.yaml")
ROBOTS = Path("robots")
FILE = "validation.yaml"
GRID = Path("data/cross_engine.yaml")
WALK = Path("data/webots.yaml")
CYCLES = Path("data/limit_cycles.yaml")
CELLS, ENGINES, WEBOTS, LIMIT_CYCLES = PARTS = ("cells", "engines", "webots", "limit_cycles")
HEADER = """\
# Thresholds of a policy on this robot, derived from a reference policy by the rules of data/validation.yaml:
#     {command}
# `cells` are the bars in MuJoCo, `engines` those of each walk of cross_engine.yaml in MuJoCo and DART, `webots` of the
# walk of webots.yaml, `limit_cycles` of strides in MuJoCo and DART. A cell that the reference policy fails itself is
# not required, with the reason.
"""


def derive(path: Path, one: Deployed, found: dict[str, dict[str, CellBars]], command: str) -> None:
    """Write parts of a robot's bars, derived from the reference policy. An existing file keeps its other parts."""
    bars = settings.read(path, RobotBars) if path.is_file() else _no_bars(one)
    reference = dataclasses.replace(_no_bars(one).reference, ankle_kd=bars.reference.ankle_kd, command=command)
    left = [part for part in PARTS if part not in found]
    if path.is_file() and left and reference != dataclasses.replace(bars.reference, command=command):
        problem = f"its {', '.join(left)} are of another policy or robot, and would stay beside the new bars."
        raise FileError(path, problem, "Derive all parts.")
    atomic.write_text(path, text_of(dataclasses.replace(bars, reference=reference, **found)))


def text_of(found: RobotBars) -> str:
    """The bars as the text of their file."""
    plain: dict[str, Any] = {name: settings.plain(getattr(found, name)) for name in ("reference", *PARTS)}
    for cell in (cell for part in PARTS for cell in plain[part].values()):
        cell["bars"] = {
            name: {key: value for key, value in bar.items() if value is not None} for name, bar in cell["bars"].items()
        }
    body = yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    return HEADER.format(command=found.reference.command) + body


def stand_in_walks(damped: Sequence[Deployed], folder: Path, plan: WebotsSettings) -> dict[str, WalkResult]:
    """The walk in each available Webots stand-in, by name. Raises FileError if one gives no result."""
    walks = {}
    for one, engine in itertools.product(damped, ("mujoco", "ode")):
        with tempfile.TemporaryDirectory() as place:
            source = read_description(folder)
            project = write_project(Path(place), source, one.task, one.envelope, one.policy, plan)
            outcome = run_stand_in(engine, project, plan)
        if outcome.result is not None:
            ankle_kd = float(one.task.kd[legs_of(one.robot).all_ankles[0]])
            walks[f"the {engine} stand-in, ankle kd {ankle_kd:g}"] = outcome.result
        elif outcome.status != NOT_RUN:
            raise FileError(project.world, f"the {engine} stand-in {outcome.status}: {outcome.reason}.")
    return walks


def _no_bars(one: Deployed) -> RobotBars:
    """The existing bars of a robot, or empty ones."""
    reference = Reference(policy=policy_digest(one.policy), robot=one.robot.digest, ankle_kd=(), command="")
    return RobotBars(reference=reference, cells={}, engines={}, webots={}, limit_cycles={})


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m pipeline.validation.derive", description=__doc__)
    parser.add_argument("policy", type=Path, help="npz of the reference policy")
    parser.add_argument("--robot", type=Path, default=Path("data/adapted_robot/t1"), help="folder of the robot")
    parser.add_argument("--file", type=Path, help="file of bars to write; default: robots/NAME/validation.yaml")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="bars to derive")
    parser.add_argument("--workers", type=int, default=0, help="processes; 0 for one each core")
    given = parser.parse_args(arguments)
    try:
        file = given.file or ROBOTS / given.robot.resolve().name / FILE
        one, pool = deployed(given.robot, load_policy(given.policy)), ClipPool(workers=given.workers)
        rules = scaled_to(settings.read(RULES, ValidationRules), one.robot)
        kept = settings.read(file, RobotBars) if file.is_file() else _no_bars(one)
        damped = [with_ankle_kd(one, kd) for kd in kept.reference.ankle_kd] or [one]
        found = {}
        if CELLS in given.parts:
            cells = full(one.robot)
            runs = [measure(each, cells, pool) for each in damped]
            found[CELLS] = derived(runs, rules.margins, rules.required)
        if ENGINES in given.parts:
            grid = settings.read(GRID, CrossEngineSettings)
            unjudged = ValidationSettings(**vars(rules), **vars(kept))
            walked = [cross_engine(each, grid, unjudged, pool=pool) for each in damped]
            found[ENGINES] = engine_bars(walked, grid, rules)
        if WEBOTS in given.parts:
            plan = settings.read(WALK, WebotsSettings)
            found[WEBOTS] = webots_bars(stand_in_walks(damped, given.robot, plan), plan, rules)
        if LIMIT_CYCLES in given.parts:
            values = settings.read(CYCLES, LimitCycleSettings)
            found[LIMIT_CYCLES] = limit_cycle_bars([limit_cycles(each, (), values, {}) for each in damped], rules)
        command = f"python -m pipeline.validation.derive {given.policy} --robot {given.robot}"
        derive(file, one, found, command)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
