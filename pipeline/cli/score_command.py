"""`booster-lab score CSV --human CLIP`: how well a robot's motion shows a person's, whoever made it."""

import json
from pathlib import Path
from typing import Any

from pipeline.cli.arguments import Score
from pipeline.cli.chain import Chain, naming_options
from pipeline.cli.text_table import name_values, text_table
from pipeline.clips.codec import faults_of
from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.files.csv_json import without_nan
from pipeline.project import find_project
from pipeline.readers import Statement, read_motion
from pipeline.scoring import FIGURES, score
from pipeline.scoring.align import same_length


def run(args: Score) -> int:
    """Print the figures."""
    project = find_project()
    with naming_options({"fps": "--fps"}):
        clip = read_motion(args.csv, args.csv.stem, Statement(fps=args.fps)).clip
    if not isinstance(clip, RobotClip):
        raise FileError(args.csv, "it is a human's motion.", "Name the robot's first, the human's after --human.")
    faults = faults_of(clip)
    if faults:
        do = "Write it again with a finite number for each joint of each frame."
        raise FileError(args.csv, f"it can't be scored: {faults[0]}.", do)
    human = piece_of(Chain(project), args.human, Statement(**vars(args.statement)), clip)
    scored = score(human, clip, project.robot(clip.robot))
    facts = {
        "csv": str(args.csv),
        "human": human.name,
        "robot": clip.robot,
        "fps": clip.fps,
        "frames": scored.frames,
    }
    print(as_json(facts, scored.figures()) if args.json else as_text(facts, scored.figures()))
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
    return json.dumps({**facts, "figures": without_nan(figures)}, indent=1, ensure_ascii=False, allow_nan=False)
