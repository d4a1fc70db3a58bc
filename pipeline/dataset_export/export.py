"""The clips of a database written in one format, with the card of these clips beside them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from pipeline.clips.robot_clip import RobotClip
from pipeline.dataset_export.archives import ARCHIVES
from pipeline.dataset_export.lerobot import write_lerobot
from pipeline.dataset_export.rerun_recording import write_rerun
from pipeline.errors import UnknownNameError
from pipeline.expert import check_database
from pipeline.expert.database_clip import read_database_clip
from pipeline.expert.dataset_card import FILE as CARD
from pipeline.expert.dataset_card import dataset_card
from pipeline.expert.swap import current
from pipeline.files import atomic
from pipeline.robot import Robot

LEROBOT, RERUN = "lerobot", "rerun"
FORMATS = (*ARCHIVES, LEROBOT, RERUN)
"""What a database can be exported as."""
SUFFIXES = {**dict.fromkeys(ARCHIVES, ".npz"), RERUN: ".rrd"}
"""Suffix of a clip's file, of formats that have one each."""


def export_database(
    database: Path,
    kind: str,
    robots: Callable[[str], Robot],
    out: Path,
    skills: Sequence[str] = (),
    naming: str | None = None,
) -> int:
    """Write the clips of a database, or those of some skills, into the folder `out`; how many.

    Args:
        kind: one of `FORMATS`
        robots: the robot of a name
        skills: clips of these alone; of all where none is named
        naming: a column of the robot's aliases.csv that the joints are called by; None for the robot's own names

    Raises DatabaseError for a database that is not whole, UnknownNameError for a skill that it does not have, and
    NotInstalledError where a format needs a package that is not there.
    """
    contents = check_database(database)
    known = sorted(set(contents.index["skill"]))
    for skill in skills:
        if skill not in known:
            raise UnknownNameError("skill", skill, known)
    rows = contents.index.loc[contents.index["skill"].isin(list(skills or known))]
    out.mkdir(parents=True, exist_ok=True)

    def clips(robot: Robot, named: Robot) -> Iterator[tuple[RobotClip, str, str]]:
        for file, skill in zip(rows["file"], rows["skill"], strict=True):
            clip, _ = read_database_clip(current(database) / file, robot)
            yield dataclasses.replace(clip, joint_names=named.joint_names), skill, file

    robot = robots(contents.manifest["robot"])
    named = robot.in_naming(naming) if naming else robot
    written = export_clips(kind, clips(robot, named), named, out)
    atomic.write_text(out / CARD, dataset_card(contents.manifest, rows))
    return written


def export_clips(kind: str, clips: Iterable[tuple[RobotClip, str, str]], robot: Robot, out: Path) -> int:
    """Write clips, each with its skill and its file in the database, into a folder; how many."""
    if kind == LEROBOT:
        return write_lerobot(out, ((clip, skill) for clip, skill, _ in clips))
    count = 0
    for clip, _, file in clips:
        path = output_file(out, kind, file)
        if kind == RERUN:
            write_rerun(path, clip, robot)
        else:
            atomic.write_bytes(path, ARCHIVES[kind](clip, robot))
        count += 1
    return count


def output_file(out: Path, kind: str, file: str) -> Path:
    """Where a clip of the database's file goes."""
    return out / Path(file).with_suffix(SUFFIXES[kind])
