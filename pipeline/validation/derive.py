"""Derive the bars from a reference policy: `python -m pipeline.validation.derive POLICY.npz [--robot FOLDER]`.

Measures the full suite with each ankle damping that `data/validation.yaml` names, and writes the file's cells anew: the
worst figure of all trials with the margin of its kind. Rules and margins stay as they are.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from pipeline.batch import ClipPool
from pipeline.deployment import digest, load_policy
from pipeline.errors import PipelineError
from pipeline.files import atomic, settings
from pipeline.validation.bars import Reference, ValidationSettings, derived
from pipeline.validation.cells import Cell
from pipeline.validation.deployed import Deployed, deployed, with_ankle_kd
from pipeline.validation.measure import Measured, measure
from pipeline.validation.numbers_file import read_numbers, write_numbers
from pipeline.validation.suites import full

FILE = Path("data/validation.yaml")
HEADER = """\
# What a policy has to do in MuJoCo. `margins` and `required` are written by hand. `reference` and `cells` are derived:
#     {command}
# A figure's bar is the reference policy's worst over all trials with the margin of that figure. A cell that the
# reference policy does not do itself is not required, and says why.
"""


def derive(path: Path, one: Deployed, runs: Sequence[Sequence[Measured]], command: str) -> None:
    """Write the cells of a settings file anew from measurements of the reference policy."""
    rules = settings.read(path, ValidationSettings)
    reference = Reference(
        policy=digest(one.policy), robot=one.robot.digest, ankle_kd=rules.reference.ankle_kd, command=command
    )
    found = dataclasses.replace(rules, reference=reference, cells=derived(runs, rules.margins, rules.required))
    atomic.write_text(path, text_of(found))


def text_of(found: ValidationSettings) -> str:
    """The settings as the text of their file."""
    plain: dict[str, Any] = settings.plain(found)
    for cell in plain["cells"].values():
        cell["bars"] = {
            name: {key: value for key, value in bar.items() if value is not None} for name, bar in cell["bars"].items()
        }
    body = yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    return HEADER.format(command=found.reference.command) + body


def measured_again(one: Deployed, cells: Sequence[Cell], pool: ClipPool, kept: Path | None) -> tuple[Measured, ...]:
    """All cells, those in the file `kept` taken from there."""
    known = read_numbers(kept, one, cells) if kept else {}
    todo = [cell for cell in cells if cell.name not in known]
    fresh = measure(one, todo, pool)
    if kept and fresh:
        write_numbers(kept, one, fresh)
    known |= {each.cell.name: each for each in fresh}
    return tuple(known[cell.name] for cell in cells)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m pipeline.validation.derive", description=__doc__)
    parser.add_argument("policy", type=Path, help="npz of the reference policy")
    parser.add_argument("--robot", type=Path, default=Path("data/adapted_robot/t1"), help="folder of the robot")
    parser.add_argument("--file", type=Path, default=FILE, help="settings file to rewrite")
    parser.add_argument("--workers", type=int, default=0, help="processes; 0 for one each core")
    parser.add_argument("--numbers", type=Path, help="JSON that keeps what was measured; what it has is not run again")
    given = parser.parse_args(arguments)
    try:
        rules = settings.read(given.file, ValidationSettings)
        one = deployed(given.robot, load_policy(given.policy))
        cells, pool = full(one.robot), ClipPool(workers=given.workers)
        runs = [measured_again(with_ankle_kd(one, kd), cells, pool, given.numbers) for kd in rules.reference.ankle_kd]
        command = f"python -m pipeline.validation.derive {given.policy} --robot {given.robot}"
        derive(given.file, one, runs, command)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
