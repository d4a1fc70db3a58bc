"""`booster-lab retarget IN --out OUT.csv`: retarget a motion file to a CSV that `pipeline.readers` can read.

# robot: t1
# fps: 50
root_x,root_y,root_z,quat_x,quat_y,quat_z,quat_w,<joint>,...
0.00000000,...
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.cli.arguments import Retarget
from pipeline.cli.chain import Chain, reason_line, with_options
from pipeline.clips.outcome import Piece, Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.project import Project, find_project
from pipeline.readers import ReadMotion, Statement
from pipeline.robot import Robot

ROOT_COLUMNS = ("root_x", "root_y", "root_z", "quat_x", "quat_y", "quat_z", "quat_w")
"""Position of the root link [m] and its quaternion xyzw, world frame."""

DECIMALS = 8
"""Decimals of a number: resolution 10 nm, 10 nrad."""


def encode_csv(clip: RobotClip, comments: Mapping[str, str]) -> str:
    """The clip as CSV: comment lines with robot, rate and `comments`, a header, one row per frame."""
    head = {"robot": clip.robot, "fps": f"{clip.fps:.10g}", **comments}
    lines = [f"# {name}: {' '.join(value.split())}" for name, value in head.items()]
    lines.append(",".join((*ROOT_COLUMNS, *clip.joint_names)))
    quat_xyzw = np.roll(clip.root_quat_w, -1, axis=1)
    values = np.concatenate([clip.root_pos_w, quat_xyzw, clip.joint_pos], axis=1)
    values = np.round(values, DECIMALS) + 0.0  # no negative zero
    row_format = ",".join([f"%.{DECIMALS}f"] * values.shape[1])
    lines += [row_format % tuple(row) for row in values.tolist()]
    return "\n".join(lines) + "\n"


FRAME_NOTE = "world, z up; the clip starts above the origin, facing +x"


@dataclass(frozen=True, kw_only=True)
class Retargeted:
    """Result of retargeting one file."""

    read: ReadMotion
    seconds_in: float
    """Duration of the clip at its true rate [s]."""
    pieces: tuple[Piece, ...]
    """Robot clips in order of time."""
    reasons: tuple[Reason, ...]
    """Reasons of all stages, in order."""


def run(args: Retarget) -> int:
    """Retarget the file, write the CSV files and print a summary."""
    if args.out.suffix.lower() != ".csv":
        raise FileError(args.out, f"OUT has the suffix '{args.out.suffix}'.", "Name a file that ends in .csv.")
    project = find_project()
    robot = project.robot(args.robot)
    done = retarget_file(project, args.input, Statement(**vars(args.statement)), robot)
    named = robot.in_naming(args.naming) if args.naming else robot
    made = [piece.clip for piece in done.pieces if isinstance(piece.clip, RobotClip)]
    clips = [dataclasses.replace(clip.resampled(args.fps), joint_names=named.joint_names) for clip in made]
    if not clips:
        why = " ".join(reason.text for reason in done.reasons if reason.effect == "rejected")
        raise FileError(args.input, "no part of it can be retargeted.", with_options(why or "No frames are left."))
    longest = max(range(len(clips)), key=lambda index: (clips[index].frame_count, -index))
    ordered = [clips[longest], *clips[:longest], *clips[longest + 1 :]]
    paths = [args.out, *(args.out.with_suffix(f".{n}.csv") for n in range(1, len(ordered)))]
    for clip, path in zip(ordered, paths, strict=True):
        atomic.write_text(path, encode_csv(clip, {"source": args.input.name, "clip": clip.name, "frame": FRAME_NOTE}))
    _report(args, done, ordered, paths)
    return 0


def retarget_file(project: Project, path: Path, stated: Statement, robot: Robot) -> Retargeted:
    """Run all stages up to retargeting on a file, with the whole clip as one window. Raises FileError, ClipError."""
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


def _report(args: Retarget, done: Retargeted, clips: list[RobotClip], paths: list[Path]) -> None:
    print(f"{args.input}: {done.seconds_in:.2f} s in ({done.read.format}, {done.read.skeleton})")
    for reason in done.reasons:
        print(f"  {reason_line(reason)}")
    seconds_out = sum(clip.duration_s for clip in clips)
    count = "1 piece" if len(clips) == 1 else f"{len(clips)} pieces"
    print(f"{seconds_out:.2f} s out in {count}, on {clips[0].robot} at {args.fps:g} Hz")
    for clip, path in zip(clips, paths, strict=True):
        print(f"  {path}: {clip.duration_s:.2f} s, {clip.frame_count} frames")
    left = args.out.with_suffix(f".{len(clips)}.csv")
    if left.exists():
        print(f"  {left} is from an earlier run and does not belong to this one")
