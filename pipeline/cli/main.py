"""Entry point of `booster-lab`: arguments in, exit code out."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from pipeline.cli import (
    check_robot_command,
    cross_engine_command,
    curate_command,
    database_command,
    export_command,
    import_robot_command,
    inspect_command,
    play_command,
    retarget_command,
    score_command,
    simulate_robot_command,
    sources_command,
    validate_command,
    view_command,
    webots_command,
)
from pipeline.errors import PipelineError

DESCRIPTION = (
    "Human motion onto a humanoid robot (Booster T1, K1): inspect a motion file, retarget it, score and play "
    "the result; validate a walking policy; import and check a robot."
)

EPILOG = (
    "Thresholds are read from the project's data/*.yaml. The database is made with: "
    "dagster asset materialize --select expert_db"
)

COMMANDS = (
    inspect_command,
    retarget_command,
    score_command,
    export_command,
    validate_command,
    cross_engine_command,
    curate_command,
    database_command,
    simulate_robot_command,
    sources_command,
    view_command,
    play_command,
    webots_command,
    import_robot_command,
    check_robot_command,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command. 0: done, 1: it could not be done (one sentence on stderr), 2: wrong usage."""
    try:
        parsed = parser().parse_args(arguments)
    except SystemExit as stop:  # argparse has printed what is wrong, or shown the help
        return int(stop.code or 0)
    try:
        return parsed.run(parsed)
    except (PipelineError, OSError) as error:
        print(f"booster-lab: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    except MemoryError:
        print("booster-lab: there is not enough memory for this; end other programs and try again.", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def parser() -> argparse.ArgumentParser:
    """All commands and their arguments."""
    whole = argparse.ArgumentParser(prog="booster-lab", description=DESCRIPTION, epilog=EPILOG)
    commands = whole.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_to(commands)
    return whole
