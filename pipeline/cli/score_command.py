"""`booster-lab score CSV --human CLIP`: how well a robot motion of any tool reproduces a human motion."""

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
    """Score the motion and print the figures."""
    project = find_project()
    with naming_options({"fps": "--fps"}):
        clip = read_motion(args.csv, args.csv.stem, Statement(fps=args.fps)).clip
    if not isinstance(clip, RobotClip):
        raise FileError(
            args.csv, "it is a human motion.", "Give the robot motion first, the human motion after --human."
        )
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
    """The longest repaired piece of a human motion file that is as long as the robot's clip.

    Raises FileError if there is none.
    """
    catalogued = chain.catalogued(chain.read(path, stated))
    repaired = [piece.clip for whole in catalogued.pieces[:1] for piece in chain.repaired(whole).pieces]
    humans = [piece for piece in repaired if isinstance(piece, HumanClip)]
    if not humans:
        raise FileError(path, "no human motion remains after repair.", f"See: booster-lab inspect {path}")
    fitting = [human for human in humans if same_length(human, clip)]
    if not fitting:
        lengths = ", ".join(f"{human.duration_s:.2f} s" for human in humans)
        problem = f"after repair it is {lengths} long, '{clip.name}' is {clip.duration_s:.2f} s."
        raise FileError(path, problem, "Retarget the repaired motion from its start, as `booster-lab retarget` does.")
    return max(fitting, key=lambda human: human.duration_s)


def as_text(facts: dict[str, Any], figures: dict[str, float]) -> str:
    """The score as text."""
    rows = [[figure.title, f"{figures[figure.key]:.4g}", figure.unit] for figure in FIGURES]
    return f"{name_values(facts)}\n\n{text_table(['figure', 'value', 'unit'], rows)}"


def as_json(facts: dict[str, Any], figures: dict[str, float]) -> str:
    """The facts, and under `figures` one number per figure; null if the motion has no sample of it."""
    return json.dumps({**facts, "figures": without_nan(figures)}, indent=1, ensure_ascii=False, allow_nan=False)
