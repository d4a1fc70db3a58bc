"""`booster-lab export DATABASE --format mjlab --out FOLDER`: the clips of a database as other programs load them."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.naming_argument import add_naming
from pipeline.cli.project import find_project
from pipeline.dataset_export import FORMATS, export_database
from pipeline.dataset_export.export import CARD, LEROBOT
from pipeline.errors import FileError
from pipeline.expert.swap import current


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "export",
        help="write the database's clips as other programs load them, with a dataset card",
        description="Write every clip of a database as an archive of mjlab and BeyondMimic (`mjlab`) or of GMR without "
        "pickle (`gmr`), as a Rerun recording (`rerun`, needs the extra booster-lab[export]), or all of them as one "
        "LeRobotDataset v3 (`lerobot`); and a dataset card (README.md) with sources, licences, seconds by skill and "
        "how it was made.",
    )
    parser.add_argument("database", metavar="DATABASE", type=Path, help="folder of a database (data/expert_db/t1)")
    parser.add_argument("--format", choices=FORMATS, required=True, help="what to write")
    parser.add_argument("--out", metavar="FOLDER", type=Path, required=True, help="folder to write into")
    parser.add_argument("--skill", metavar="NAME", nargs="+", default=[], help="clips of these skills alone")
    add_naming(parser)
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Write the files and print how many."""
    if not parsed.database.is_dir():
        raise FileError(parsed.database, "it is not a folder.", "Make the database: dagster asset materialize.")
    if parsed.out.resolve().is_relative_to(current(parsed.database).resolve()):
        raise FileError(parsed.out, "it is in the database, whose files have digests.", "Name another folder.")
    if parsed.format == LEROBOT and any(parsed.out.glob("*")):
        raise FileError(
            parsed.out, "it is not empty; a LeRobot data set is written as a whole.", "Name another folder."
        )
    robots = find_project().robot
    written = export_database(parsed.database, parsed.format, robots, parsed.out, parsed.skill, parsed.naming)
    print(f"{written} clips and {CARD} in {parsed.out}")
    return 0
