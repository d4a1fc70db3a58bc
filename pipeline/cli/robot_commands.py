"""`booster-lab import-robot` and `check-robot`: make a robot folder from a URDF or MJCF, and check it."""

import re

from pipeline.cli.arguments import CheckRobot, ImportRobot
from pipeline.errors import PipelineError
from pipeline.project import find_project
from pipeline.robot.load import read_description
from pipeline.robot_check.check import check_folder
from pipeline.robot_check.compare import JOINT, compare, model_of
from pipeline.robot_import.propose import propose
from pipeline.robot_import.read import read_model
from pipeline.robot_import.stated import NOTHING, read_stated
from pipeline.robot_import.write import readme, write_folder

NAME = re.compile(r"[a-z][a-z0-9_]*\Z")
FOUND = 3
"""Exit code for a folder with findings; 1 means that the check could not run."""


def import_robot(args: ImportRobot) -> int:
    """Read the model, propose values, write the folder, list the missing values."""
    if not NAME.match(args.name):
        raise PipelineError(
            f"--name is '{args.name}'; use lower-case letters, digits and underscores, starting with a letter."
        )
    folder = args.out or find_project().robot_folder(args.name)
    if folder.name != args.name:
        raise PipelineError(f"--out is '{folder}'; a robot's folder has the robot's name, '{args.name}'.")
    model = read_model(args.file)
    shapes = read_model(args.shapes) if args.shapes else None
    stated = read_stated(args.joints, tuple(each.name for each in model.joints)) if args.joints else NOTHING
    proposal = propose(model, args.name, shapes=shapes, stated=stated)
    robot = write_folder(folder, proposal, readme(proposal, model, shapes, stated))
    print(f"{folder}: {len(robot.joint_names)} joints, {robot.total_mass:.3f} kg, legs of {robot.leg_length:.3f} m")
    for note in proposal.notes:
        print(f"  not used: {note}")
    for text in proposal.to_state:
        print(f"  to state: {text}")
    print(f"Edit the tables, then run: python -m pipeline.robot.render {folder}")
    return 0


def check_robot(args: CheckRobot) -> int:
    """Print one line per finding and per difference. Returns the exit code."""
    found = check_folder(args.folder)
    for each in found:
        print(each)
    print(f"{args.folder}: {len(found) or 'no'} finding{'' if len(found) == 1 else 's'}")
    if args.against is not None:
        differences = compare(model_of(read_description(args.folder.resolve())), read_model(args.against))
        shown = [each for each in differences if each.of_both or each.figure == JOINT]
        for each in shown:
            print(f"  {each}")
        silent = sorted({each.figure for each in differences if each not in shown})
        note = f" (it does not state every {', '.join(silent)})" if silent else ""
        print(f"{args.against}: {len(shown) or 'no'} difference{'' if len(shown) == 1 else 's'}{note}")
    return FOUND if found else 0
