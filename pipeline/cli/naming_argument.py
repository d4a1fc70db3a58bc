"""The option `--naming` of commands that write joints by name."""

from __future__ import annotations

import argparse


def add_naming(parser: argparse.ArgumentParser) -> None:
    """Add the option."""
    parser.add_argument(
        "--naming",
        metavar="NAMING",
        help="names of the joints in what is written: a column of the robot's aliases.csv (default: the robot's own)",
    )
