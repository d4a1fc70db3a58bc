"""Export a trained policy: `python -m pipeline.export RUN --robot t1 --name NAME --out DIR`.

RUN                 folder of a training run: policy.npz, config.json, curves.csv, done.json
--policy FILE       another npz than RUN/policy.npz: that of a chosen checkpoint
--robot NAME        folder of robots/
--name NAME         of the policy
--commit HASH       of the code that trained it
--command TEXT      that made it, to make it again
--figures FILE      JSON of what was measured of it
--out DIR           where the export goes
--shippable         mark it as one that may ship; refused where its database's licence forbids it
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import FileError, PipelineError
from pipeline.export.folder import CURVES, POLICY, Source, export_policy
from pipeline.export.training_run import training_data, training_run
from pipeline.robot import load_robot


def main(arguments: list[str]) -> int:
    """Export; 0 when it is written, 2 when it is refused, the reason on stderr."""
    asked = _parser().parse_args(arguments)
    try:
        curves = asked.run / CURVES
        source = Source(
            policy=asked.policy or asked.run / POLICY,
            run=training_run(asked.run, commit=asked.commit, command=asked.command),
            data=training_data(asked.run),
            curves=curves if curves.is_file() else None,
            figures=_json(asked.figures) if asked.figures else None,
        )
        card = export_policy(
            asked.out, asked.name, load_robot(asked.robot), source, np.random.default_rng(0), shippable=asked.shippable
        )
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 2
    parity = max(card.parity["onnx"], card.parity["torch_script"])
    print(f"{asked.out}: policy '{card.name}', digest {card.digest[:12]}, parity {parity:.1e}, ships: {card.shippable}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m pipeline.export", description="Export a trained policy.")
    parser.add_argument("run", type=Path)
    parser.add_argument("--policy", type=Path)
    parser.add_argument("--robot", default="t1")
    parser.add_argument("--name", required=True)
    parser.add_argument("--commit", default="")
    parser.add_argument("--command", default="")
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--shippable", action="store_true")
    return parser


def _json(path: Path) -> dict[str, Any]:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise FileError(path, f"is no JSON ({error}).") from error


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
