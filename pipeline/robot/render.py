"""Command: write the MJCF and the URDF of robot folders from their tables.

python -m pipeline.robot.render robots/t1
"""

import argparse
import sys
from pathlib import Path

from pipeline.files import atomic
from pipeline.robot.build import build_robot
from pipeline.robot.load import model_files, read_description
from pipeline.robot.robot_error import RobotError


def main(arguments: list[str]) -> int:
    """Render each folder. Returns the exit status: 0, or 1 when a folder has faults."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.robot.render", description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER", help="folder of a robot (robots/t1)")
    try:
        for folder in (path.resolve() for path in parser.parse_args(arguments).folders):
            for path, text in model_files(folder, build_robot(read_description(folder))).items():
                atomic.write_text(path, text)
                print(path)
    except RobotError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
