"""`booster-lab check-robot DIR [AGAINST]`: what a robot folder lacks or contradicts. The exit code is the verdict."""

from __future__ import annotations

import argparse
from pathlib import Path

FOUND = 3
"""Exit code of a folder with findings; 1 is of a check that could not be done."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "check-robot",
        help="find what a robot folder lacks or contradicts",
        description="Check masses, limits, mirror map, human correspondence, soles, balance, model files and gains of "
        "a robot folder; with another model file of the robot, list the differences joint by joint. Exit code 0: "
        "nothing found, 3: found, 1: could not be done. Differences from the other file do not change the exit code.",
    )
    parser.add_argument("folder", metavar="DIR", type=Path, help="folder of the robot (robots/k1)")
    parser.add_argument("against", metavar="AGAINST", type=Path, nargs="?", help="URDF or MJCF of the same robot")
    parser.set_defaults(run=run)


def run(parsed: argparse.Namespace) -> int:
    """Print a line for each finding and for each difference."""
    from pipeline.robot.load import read_description
    from pipeline.robot_check import check_folder, compare
    from pipeline.robot_check.compare import JOINT, model_of
    from pipeline.robot_import import read_model

    found = check_folder(parsed.folder)
    for each in found:
        print(each)
    print(f"{parsed.folder}: {len(found) or 'no'} finding{'' if len(found) == 1 else 's'}")
    if parsed.against is not None:
        differences = compare(model_of(read_description(parsed.folder.resolve())), read_model(parsed.against))
        shown = [each for each in differences if each.of_both or each.figure == JOINT]
        for each in shown:
            print(f"  {each}")
        silent = sorted({each.figure for each in differences if each not in shown})
        note = f" (it does not state every {', '.join(silent)})" if silent else ""
        print(f"{parsed.against}: {len(shown) or 'no'} difference{'' if len(shown) == 1 else 's'}{note}")
    return FOUND if found else 0
