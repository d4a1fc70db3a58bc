"""Export a trained policy: `python -m pipeline.export RUN --robot t1 --name NAME --out DIR`."""

import argparse
import sys
from pathlib import Path

import numpy as np

from pipeline.errors import PipelineError
from pipeline.export.card import FILE, ModelCard
from pipeline.export.folder import complete_export, export_policy, source_of_run
from pipeline.export.metadata import ExportError
from pipeline.robot import load_robot


def main(arguments: list[str]) -> int:
    """Export. Returns 0, or 2 with the reason on stderr if the export is refused."""
    given = _parser().parse_args(arguments)
    try:
        card = _export(given)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 2
    parity = max(card.parity["onnx"], card.parity["torch_script"])
    print(f"{given.out}: policy '{card.name}', digest {card.digest[:12]}, parity {parity:.1e}, ships: {card.shippable}")
    return 0


def _export(given: argparse.Namespace) -> ModelCard:
    robot, rng = load_robot(given.robot), np.random.default_rng(0)
    robot = robot.in_naming(given.naming) if given.naming else robot
    if not given.run.is_dir():
        raise ExportError(f"{given.run}: there is no such folder. Name the folder of a training run.")
    if (given.run / FILE).is_file():
        return complete_export(given.run, given.out, robot, rng)
    if given.name is None:
        raise ExportError("--name is missing; give the policy a name.")
    stated = {name: text for name, text in (("commit", given.commit), ("command", given.command)) if text}
    source = source_of_run(given.run, given.policy, stated, given.figures, given.beside, given.held_out)
    return export_policy(given.out, given.name, robot, source, rng, shippable=given.shippable, compact=given.compact)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline.export", description="Export a trained policy.")
    compact = "or of a compact export (with card.json), which is completed by --robot, --naming and --out alone"
    parser.add_argument("run", type=Path, help=f"folder of a training run (pipeline.training), {compact}")
    parser.add_argument("--policy", type=Path, help="npz of a chosen checkpoint, instead of RUN/policy.npz")
    parser.add_argument("--robot", default="t1", help="folder of robots/")
    parser.add_argument("--name", help="name of the policy")
    parser.add_argument("--naming", help="joint names of ONNX and booster_deploy: a column of robots/NAME/aliases.csv")
    parser.add_argument("--commit", default="", help="commit of the code that trained it, instead of the run's")
    parser.add_argument("--command", default="", help="command that trained it, instead of the run's")
    parser.add_argument("--figures", type=Path, help="JSON of measured figures, instead of the run's validation")
    beside = "runs of the same recipe with other seeds; the card states their figures too"
    parser.add_argument("--beside", type=Path, nargs="+", default=(), metavar="RUN", help=beside)
    parser.add_argument("--held-out", type=Path, metavar="JSON", help="verdict by the suite held-out, for the card")
    parser.add_argument("--out", type=Path, required=True, help="output folder")
    shippable = "mark it as a policy that may ship; refused if its database's licence forbids it"
    parser.add_argument("--shippable", action="store_true", help=shippable)
    parser.add_argument("--compact", action="store_true", help="leave out ONNX and booster_deploy, which are derived")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
