"""Export a trained policy: `python -m pipeline.export RUN --robot t1 --name NAME --out DIR`.

RUN                 folder of a training run (`pipeline.training`); or of a compact export
                    (it has card.json), which is then completed: only --robot, --naming and --out are read
--policy FILE       npz of a chosen checkpoint, instead of RUN/policy.npz
--robot NAME        folder of robots/
--name NAME         name of the policy
--commit HASH       commit of the code that trained it, instead of what the run states
--command TEXT      command that trained it, likewise
--figures FILE      JSON with its measured figures, instead of those of the run's validation
--out DIR           output folder
--shippable         mark it as a policy that may ship; refused if its database's licence forbids it
--naming NAMING     names of the joints in ONNX metadata and booster_deploy task: a column of robots/NAME/aliases.csv
--compact           leave out ONNX and the booster_deploy task, which are derived from policy.npz
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.export.card import FILE, ModelCard
from pipeline.export.folder import complete_export, export_policy, source_of_run
from pipeline.export.metadata import ExportError
from pipeline.robot import Robot, load_robot


def main(arguments: list[str]) -> int:
    """Export. Returns 0, or 2 with the reason on stderr if the export is refused."""
    given = _parser().parse_args(arguments)
    try:
        card = _complete(given) if (given.run / FILE).is_file() else _export(given)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 2
    parity = max(card.parity["onnx"], card.parity["torch_script"])
    print(f"{given.out}: policy '{card.name}', digest {card.digest[:12]}, parity {parity:.1e}, ships: {card.shippable}")
    return 0


def _export(given: argparse.Namespace) -> ModelCard:
    if given.name is None:
        raise ExportError("--name is missing; give the policy a name.")
    stated = {name: text for name, text in (("commit", given.commit), ("command", given.command)) if text}
    source = source_of_run(given.run, given.policy, stated, given.figures)
    robot, rng = _robot(given), np.random.default_rng(0)
    return export_policy(given.out, given.name, robot, source, rng, shippable=given.shippable, compact=given.compact)


def _complete(given: argparse.Namespace) -> ModelCard:
    return complete_export(given.run, given.out, _robot(given), np.random.default_rng(0))


def _robot(given: argparse.Namespace) -> Robot:
    robot = load_robot(given.robot)
    return robot.in_naming(given.naming) if given.naming else robot


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline.export", description="Export a trained policy.")
    parser.add_argument("run", type=Path)
    parser.add_argument("--policy", type=Path)
    parser.add_argument("--robot", default="t1")
    parser.add_argument("--name")
    parser.add_argument("--naming")
    parser.add_argument("--commit", default="")
    parser.add_argument("--command", default="")
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--shippable", action="store_true")
    parser.add_argument("--compact", action="store_true")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
