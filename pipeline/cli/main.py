"""Entry point of `booster-lab`: arguments in, exit code out."""

import importlib
import importlib.metadata
import inspect
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Union

import tyro

from pipeline.cli import arguments as kinds
from pipeline.cli import policy_arguments as policies
from pipeline.errors import PipelineError

DESCRIPTION = (
    "Human motion for a humanoid robot (Booster T1, K1): inspect a motion file, retarget it, score and play the "
    "result; evaluate a walking policy; import and check a robot. Thresholds are read from the project's data/*.yaml. "
    "To make the database, run: dagster asset materialize --select expert_db\n\n"
    "--version prints the version, --tyro-print-completion {bash,zsh,fish} a completion script for your shell."
)

COMMANDS: dict[str, tuple[type, str]] = {
    "inspect": (kinds.Inspect, "inspect_command:run"),
    "retarget": (kinds.Retarget, "retarget_command:run"),
    "score": (kinds.Score, "score_command:run"),
    "export": (kinds.Export, "database_commands:export"),
    "validate": (policies.Validate, "policy_commands:validate_policy"),
    "cross-engine": (policies.CrossEngine, "policy_commands:compare_engines"),
    "curate": (kinds.Curate, "view_command:curate"),
    "database": (kinds.Database, "database_commands:database"),
    "simulate-robot": (policies.SimulateRobot, "simulate_robot_command:run"),
    "sources": (kinds.Sources, "database_commands:sources"),
    "store": (kinds.Store, "database_commands:store_size"),
    "view": (kinds.View, "view_command:view_clip"),
    "play": (policies.Play, "policy_commands:play"),
    "webots-project": (policies.WebotsProject, "webots_command:run"),
    "import-robot": (kinds.ImportRobot, "robot_commands:import_robot"),
    "check-robot": (kinds.CheckRobot, "robot_commands:check_robot"),
}
"""Name -> class of the arguments, and function in `pipeline.cli` that runs it, whose module is imported on demand."""

CONFIG = (tyro.conf.FlagCreatePairsOff,)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code. 0: done, 1: failed (message on stderr), 2: wrong usage."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words == ["--version"]:
        print(f"booster-lab {importlib.metadata.version('booster-lab')}")
        return 0
    try:
        code = _run(words)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader of the output closed the pipe, for example `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes stdout again at exit
        return 141
    except (PipelineError, OSError) as error:
        print(f"booster-lab: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    except MemoryError:
        print("booster-lab: there is not enough memory for this; end other programs and try again.", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def _run(words: Sequence[str]) -> int:
    """Exit code of the command in `words`, or of its help."""
    try:
        parsed = parse(words)
    except SystemExit as stop:  # tyro has printed an error or the help
        return int(stop.code or 0)
    module, function = COMMANDS[words[0]][1].split(":")
    return getattr(importlib.import_module(f"pipeline.cli.{module}"), function)(parsed)


def parse(words: Sequence[str]) -> Any:
    """The arguments of the command in `words`. Raises SystemExit after help, a completion script or a usage error."""
    if words and words[0] in COMMANDS:
        kind, _ = COMMANDS[words[0]]
        return tyro.cli(kind, prog=f"booster-lab {words[0]}", args=words[1:], config=CONFIG)
    every = tuple(
        Annotated[kind, tyro.conf.subcommand(name, description=(inspect.getdoc(kind) or "").split("\n")[0])]
        for name, (kind, _) in COMMANDS.items()
    )
    union: Any = Union[every]  # noqa: UP007
    return tyro.cli(union, prog="booster-lab", description=DESCRIPTION, args=words, config=CONFIG)
