"""`python -m pipeline.webots.stand_in --engine mujoco [webots' flags] world.wbt`: takes and ignores Webots' flags."""

import argparse
import sys
from pathlib import Path

from pipeline.errors import PipelineError
from pipeline.webots.stand_in.serve import serve

FLAGS = ("--batch", "--no-rendering", "--minimize", "--stdout", "--stderr")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", choices=("mujoco", "ode"), required=True)
    for flag in FLAGS:
        parser.add_argument(flag, action="store_true")
    parser.add_argument("--mode")
    parser.add_argument("--port")
    parser.add_argument("world", type=Path)
    arguments = parser.parse_args()
    try:
        return serve(arguments.world, arguments.engine)
    except PipelineError as error:
        print(error, file=sys.stderr)
        return 3


if __name__ == "__main__":
    sys.exit(main())
