"""`booster-lab score CSV --human CLIP`: how well a robot's motion shows a person's, whoever made it."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from pipeline.cli.chain import Chain
from pipeline.cli.project import find_project
from pipeline.cli.statement_arguments import add_statement, positive, statement_of
from pipeline.cli.text_table import name_values, text_table
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.readers import Statement, read_motion
from pipeline.scoring import FIGURES, score
from pipeline.scoring.align import same_length


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "score",
        help="tell how well a robot's motion shows a human's",
        description="Hold a robot's motion (CSV, from this project or from any other retargeting) against the human "
        "motion that it was made of: feet, ground, limits, smoothness, self-collision, likeness. The human's file is "
        "read and repaired as for `retarget`; the CSV has to start with it, in the world that repair leaves it in.",
    )
    parser.add_argument("csv", metavar="CSV", type=Path, help="the robot's motion")
    parser.add_argument("--human", metavar="CLIP", type=Path, required=True, help="the human's motion file")
    parser.add_argument("--fps", metavar="HZ", type=positive, help="rate of CSV, where it does not say it")
    parser.add_argument("--json", action="store_true", help="print a JSON object")
    add_statement(parser)
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Print the figures."""
    project = find_project()
    clip = read_motion(parsed.csv, parsed.csv.stem, Statement(fps=parsed.fps)).clip
    if not isinstance(clip, RobotClip):
        raise FileError(parsed.csv, "it is a human's motion.", "Name the robot's first, the human's after --human.")
    human = piece_of(Chain(project), parsed.human, statement_of(parsed), clip)
    scored = score(human, clip, project.robot(clip.robot))
    facts = {
        "csv": str(parsed.csv),
        "human": human.name,
        "robot": clip.robot,
        "fps": clip.fps,
        "frames": scored.frames,
    }
    print(as_json(facts, scored.figures()) if parsed.json else as_text(facts, scored.figures()))
    return 0


def piece_of(chain: Chain, path: Path, stated: Statement, clip: RobotClip) -> HumanClip:
    """The repaired piece of a human's file that is as long as the robot's clip, the longest of several.

    Raises FileError where there is none.
    """
    catalogued = chain.catalogued(chain.read(path, stated))
    repaired = [piece.clip for whole in catalogued.pieces[:1] for piece in chain.repaired(whole).pieces]
    humans = [piece for piece in repaired if isinstance(piece, HumanClip)]
    if not humans:
        raise FileError(path, "repair leaves no human motion of it.", f"See: booster-lab inspect {path}")
    fitting = [human for human in humans if same_length(human, clip)]
    if not fitting:
        lengths = ", ".join(f"{human.duration_s:.2f} s" for human in humans)
        problem = f"after repair it is {lengths} long, '{clip.name}' is {clip.duration_s:.2f} s."
        raise FileError(
            path, problem, "Retarget what `booster-lab retarget` works on: the repaired motion from its start."
        )
    return max(fitting, key=lambda human: human.duration_s)


def as_text(facts: dict[str, Any], figures: dict[str, float]) -> str:
    """For a person."""
    rows = [[figure.title, f"{figures[figure.key]:.4g}", figure.unit] for figure in FIGURES]
    return f"{name_values(facts)}\n\n{text_table(['figure', 'value', 'unit'], rows)}"


def as_json(facts: dict[str, Any], figures: dict[str, float]) -> str:
    """The facts and, under `figures`, a number a figure; null where the motion has no sample of it."""
    values = {key: value if math.isfinite(value) else None for key, value in figures.items()}
    return json.dumps({**facts, "figures": values}, indent=1, ensure_ascii=False, allow_nan=False)
