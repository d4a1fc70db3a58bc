"""`booster-lab export DATABASE --format mjlab --out FOLDER`: the clips of a database as other programs load them."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from pipeline.cli.database_clip import read_database_clip
from pipeline.cli.naming_argument import add_naming
from pipeline.cli.project import find_project
from pipeline.errors import FileError, UnknownNameError
from pipeline.expert import ARCHIVES, check_database, dataset_card
from pipeline.expert.swap import current
from pipeline.files import atomic

CARD = "README.md"


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "export",
        help="write the database's clips as other programs load them, with a dataset card",
        description="Write every clip of a database as an archive: mjlab and BeyondMimic (`mjlab`) or GMR without "
        "pickle (`gmr`), and a dataset card (README.md) with sources, licences, seconds by skill and how it was made. "
        "The format `card` writes the card alone.",
    )
    parser.add_argument("database", metavar="DATABASE", type=Path, help="folder of a database (data/expert_db/t1)")
    parser.add_argument("--format", choices=(*ARCHIVES, "card"), required=True, help="what to write")
    parser.add_argument("--out", metavar="FOLDER", type=Path, required=True, help="folder to write into")
    parser.add_argument("--skill", metavar="NAME", nargs="+", default=[], help="clips of these skills alone")
    add_naming(parser)
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Write the files and print how many."""
    if not parsed.database.is_dir():
        raise FileError(parsed.database, "it is not a folder.", "Make the database: dagster asset materialize.")
    contents = check_database(parsed.database)
    if parsed.out.resolve().is_relative_to(current(parsed.database).resolve()):
        raise FileError(parsed.out, "it is in the database, whose files have digests.", "Name another folder.")
    skills = sorted(set(contents.index["skill"]))
    for skill in parsed.skill:
        if skill not in skills:
            raise UnknownNameError("skill", skill, skills)
    rows = contents.index
    rows = rows[rows["skill"].isin(parsed.skill)] if parsed.skill else rows
    parsed.out.mkdir(parents=True, exist_ok=True)
    written = 0
    if parsed.format != "card":
        robot = find_project().robot(contents.manifest["robot"])
        named = robot.in_naming(parsed.naming) if parsed.naming else robot
        encode = ARCHIVES[parsed.format]
        for file in rows["file"]:
            clip, _ = read_database_clip(current(parsed.database) / file, robot)
            renamed = dataclasses.replace(clip, joint_names=named.joint_names)
            atomic.write_bytes(parsed.out / Path(file).with_suffix(".npz"), encode(renamed, named))
            written += 1
    atomic.write_text(parsed.out / CARD, dataset_card(contents))
    print(f"{written} clips and {CARD} in {parsed.out}")
    return 0
