"""`booster-lab sources`: the motion folders that runs have used, and how one is taken out for good."""

from __future__ import annotations

import argparse

from pipeline.cli.project import find_project
from pipeline.cli.text_table import text_table
from pipeline.readers.remembered import forget, read_remembered


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "sources",
        help="list the motion folders in use, or forget one",
        description="Runs record which motion folders they used. A folder of BOOSTER_LAB_MOTIONS stays a source until "
        "it is forgotten; a source that is gone stops a run before its clips leave the database.",
    )
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="show the sources that runs have used")
    listing.set_defaults(run=run_list)
    forgetting = actions.add_parser("forget", help="take sources out; the next run makes the database without them")
    forgetting.add_argument("names", metavar="NAME", nargs="+", help="name of a source, as `list` shows it")
    forgetting.set_defaults(run=run_forget)


def run_list(parsed: argparse.Namespace) -> int:
    """Print a line for each source."""
    known = read_remembered(find_project().remembered_sources)
    if not known:
        print("no run has used a source yet")
        return 0
    rows = [[each.name, each.files, each.named_in, each.folder] for each in known]
    print(text_table(["source", "files", "named in", "folder"], rows))
    return 0


def run_forget(parsed: argparse.Namespace) -> int:
    """Take sources out of the record."""
    for each in forget(find_project().remembered_sources, parsed.names):
        print(f"forgotten: {each.text()}")
    return 0
