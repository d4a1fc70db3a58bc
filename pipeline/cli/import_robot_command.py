"""`booster-lab import-robot FILE --name NAME`: a robot folder from its maker's URDF or MJCF."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from pipeline.cli.project import find_project
from pipeline.errors import PipelineError

NAME = re.compile(r"[a-z][a-z0-9_]*\Z")


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "import-robot",
        help="make a robot folder from a URDF or MJCF",
        description="Write a robot folder with the figures of its maker's model file, primitives in place of meshes, "
        "sites at soles, hands and joints, and a proposed human correspondence and mirror map; list what a person must "
        "still state.",
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="URDF or MJCF of the robot")
    parser.add_argument("--name", metavar="NAME", required=True, help="name of the robot and of its folder")
    parser.add_argument(
        "--shapes", metavar="FILE", type=Path, help="another model file of the robot, to take its shapes and sites from"
    )
    parser.add_argument(
        "--joints",
        metavar="CSV",
        type=Path,
        help="values that take the place of the file's: the column joint and any others of joints.csv",
    )
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="where to write (default: robots/NAME)")
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Read, propose, write, list."""
    from pipeline.robot_import import propose, read_model, read_stated, write_folder
    from pipeline.robot_import.readme import readme
    from pipeline.robot_import.stated import NOTHING

    if not NAME.match(parsed.name):
        raise PipelineError(f"--name is '{parsed.name}'; write small letters, digits and underscores, a letter first.")
    folder = parsed.out or find_project().root / "robots" / parsed.name
    if folder.name != parsed.name:
        raise PipelineError(f"--out is '{folder}'; a robot's folder has the robot's name, '{parsed.name}'.")
    model = read_model(parsed.file)
    shapes = read_model(parsed.shapes) if parsed.shapes else None
    stated = read_stated(parsed.joints, tuple(each.name for each in model.joints)) if parsed.joints else NOTHING
    proposal = propose(model, parsed.name, shapes=shapes, stated=stated)
    robot = write_folder(folder, proposal, readme(proposal, model, shapes, stated))
    print(f"{folder}: {len(robot.joint_names)} joints, {robot.total_mass:.3f} kg, legs of {robot.leg_length:.3f} m")
    for note in proposal.notes:
        print(f"  not used: {note}")
    for text in proposal.to_state:
        print(f"  to state: {text}")
    print(f"Edit the tables, then run: python -m pipeline.robot.render {folder}")
    return 0
