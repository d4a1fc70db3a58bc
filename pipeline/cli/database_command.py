"""`booster-lab database`: the versions of an expert database that are kept, and how one comes back."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pipeline.cli.project import find_project
from pipeline.cli.text_table import text_table
from pipeline.errors import FileError
from pipeline.expert import history, manifest


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "database",
        help="list the versions of the expert database, or put one in place",
        description="Earlier versions of the expert database are kept beside it, and so is one that was not let in "
        "because it lost too many clips.",
    )
    actions = parser.add_subparsers(title="actions", required=True, metavar="ACTION")
    listing = actions.add_parser("list", help="show the database in place and the versions that are kept")
    listing.set_defaults(run=run_list)
    summary = actions.add_parser("summary", help="say what the database in place holds and what to do next")
    summary.set_defaults(run=run_summary)
    restoring = actions.add_parser("restore", help="put a version in place; the one that was there is kept")
    restoring.add_argument("version", metavar="VERSION", help="as `list` shows it")
    restoring.set_defaults(run=run_restore)
    for each in (listing, summary, restoring):
        each.add_argument("--robot", metavar="NAME", default="t1", help="robot whose database it is")


def run_list(parsed: argparse.Namespace) -> int:
    """Print a line for each version, the one in place first."""
    folder = _folder(parsed.robot)
    versions = history.read_versions(folder)
    try:
        versions.insert(0, history.describe(folder, "current"))
    except FileError:
        print(f"{folder}: no database is in place")
    if versions:
        rows = [[each.name, each.clips, each.seconds] for each in versions]
        print(text_table(["version", "clips", "seconds"], rows))
    return 0


def run_summary(parsed: argparse.Namespace) -> int:
    """Print what the database in place holds: clips, seconds, skills, where, and what to do next."""
    folder = _folder(parsed.robot)
    version = history.describe(folder, "current")
    seconds = json.loads((folder / manifest.FILE).read_text())["seconds_by_skill"]
    skills = ", ".join(f"{skill} {value:.0f} s" for skill, value in seconds.items())
    sources = ", ".join(f"{source} {clips}" for source, clips in version.by_source.items())
    print(
        f"\nThe expert database of the {parsed.robot} has {version.clips} clips, {version.seconds:.0f} s.\n"
        f"  skills   {skills}\n  sources  {sources}\n  folder   {folder}\n\n"
        f"Next, with the environment active (source .venv/bin/activate):\n"
        f"  booster-lab curate                              watch, accept and exclude clips in the browser\n"
        f"  dagster dev                                     the graph and each stage's report: http://localhost:3000\n"
        f"  booster-lab play robots/t1/policies/walk        command the shipped policy\n"
        f"  docs/sources.md                                 bring your own recordings"
    )
    return 0


def run_restore(parsed: argparse.Namespace) -> int:
    """Put a version in place."""
    folder = _folder(parsed.robot)
    made = history.restore(folder, parsed.version)
    print(f"{folder}: {made.name} is in place, {made.clips} clips, {made.seconds:.1f} s.")
    print("The next `dagster asset materialize --select expert_db` writes the database of the present sources again.")
    return 0


def _folder(robot: str) -> Path:
    """The database of a robot. Raises UnknownNameError."""
    project = find_project()
    project.robot(robot)
    return project.root / "data" / "expert_db" / robot
