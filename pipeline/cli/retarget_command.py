"""`booster-lab retarget IN --out OUT.csv`: a motion file onto the robot, as CSV."""

from __future__ import annotations

import argparse
import dataclasses
from dataclasses import dataclass
from pathlib import Path

from pipeline.cli.chain import Chain, reason_line
from pipeline.cli.naming_argument import add_naming
from pipeline.cli.project import Project, find_project
from pipeline.cli.robot_csv import encode_csv
from pipeline.cli.statement_arguments import add_statement, positive, statement_of
from pipeline.clips.outcome import Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.readers import ReadMotion, Statement
from pipeline.robot import Robot

CSV_FPS = 30.0
"""Rate of the result when none is asked for [Hz]: as most recordings have it."""

FRAME_NOTE = "world, z up; the clip starts above the origin, facing +x"


@dataclass(frozen=True, kw_only=True)
class Retargeted:
    """What came of one file."""

    read: ReadMotion
    seconds_in: float
    """Of the clip at its true rate [s]."""
    pieces: tuple[Piece, ...]
    """Robot clips in order of time."""
    reasons: tuple[Reason, ...]
    """Of all stages, in their order."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "retarget",
        help="put a motion onto the robot, as CSV",
        description="Read a motion file, repair it, retarget it onto the robot and write the robot's motion as CSV: "
        "root position [m], root quaternion xyzw, joints [rad] by name. Where damage cuts the motion, the longest "
        "piece goes to OUT.csv and the others, in order of time, to OUT.1.csv, OUT.2.csv, …",
    )
    parser.add_argument("input", metavar="IN", type=Path, help="motion file (.bvh, .npz, .amc, .txt, .csv)")
    parser.add_argument("--out", metavar="OUT.csv", type=Path, required=True, help="where to write")
    parser.add_argument("--robot", default="t1", help="a folder of robots/ (default: t1)")
    parser.add_argument("--fps", metavar="HZ", type=positive, default=CSV_FPS, help="rate of OUT.csv (default: 30)")
    add_naming(parser)
    add_statement(parser)
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Do it and say what was done."""
    if parsed.out.suffix.lower() != ".csv":
        raise FileError(parsed.out, f"OUT ends in '{parsed.out.suffix}'.", "Name a file that ends in .csv.")
    project = find_project()
    robot = project.robot(parsed.robot)
    done = retarget_file(project, parsed.input, statement_of(parsed), robot)
    named = robot.in_naming(parsed.naming) if parsed.naming else robot
    clips = [dataclasses.replace(_at_rate(piece, parsed.fps), joint_names=named.joint_names) for piece in done.pieces]
    if not clips:
        why = " ".join(reason.text for reason in done.reasons if reason.effect == "rejected")
        raise FileError(parsed.input, f"nothing of it can be retargeted. {why or 'No frames are left.'}")
    longest = max(range(len(clips)), key=lambda index: (clips[index].frame_count, -index))
    ordered = [clips[longest], *clips[:longest], *clips[longest + 1 :]]
    paths = [parsed.out, *(parsed.out.with_suffix(f".{n}.csv") for n in range(1, len(ordered)))]
    for clip, path in zip(ordered, paths, strict=True):
        atomic.write_text(path, encode_csv(clip, {"source": parsed.input.name, "clip": clip.name, "frame": FRAME_NOTE}))
    _report(parsed, done, ordered, paths)
    return 0


def retarget_file(project: Project, path: Path, stated: Statement, robot: Robot) -> Retargeted:
    """A motion file through all stages up to the robot, the whole clip as one window. Raises FileError, ClipError."""
    chain = Chain(project)
    read = chain.read(path, stated)
    catalogued = chain.catalogued(read)
    reasons, pieces = list(catalogued.reasons), []
    seconds_in = read.motion.clip.duration_s
    for whole in catalogued.pieces[:1]:
        seconds_in = whole.clip.duration_s
        repaired = chain.repaired(whole)
        reasons += repaired.reasons
        for piece in repaired.pieces:
            outcome = chain.retargeted(piece, whole.numbers, robot)
            pieces += outcome.pieces
            reasons += outcome.reasons
    return Retargeted(read=read.motion, seconds_in=seconds_in, pieces=tuple(pieces), reasons=tuple(reasons))


def _at_rate(piece: Piece, fps: float) -> RobotClip:
    assert isinstance(piece.clip, RobotClip)
    return piece.clip.resampled(fps)


def _report(parsed: argparse.Namespace, done: Retargeted, clips: list[RobotClip], paths: list[Path]) -> None:
    print(f"{parsed.input}: {done.seconds_in:.2f} s in ({done.read.format}, {done.read.skeleton})")
    for reason in done.reasons:
        print(f"  {reason_line(reason)}")
    seconds_out = sum(clip.duration_s for clip in clips)
    count = "1 piece" if len(clips) == 1 else f"{len(clips)} pieces"
    print(f"{seconds_out:.2f} s out in {count}, on {clips[0].robot} at {parsed.fps:g} Hz")
    for clip, path in zip(clips, paths, strict=True):
        print(f"  {path}: {clip.duration_s:.2f} s, {clip.frame_count} frames")
    left = parsed.out.with_suffix(f".{len(clips)}.csv")
    if left.exists():
        print(f"  {left} is left from an earlier run and is not part of this one")
