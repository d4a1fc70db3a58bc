"""Run a project in Webots or in a stand-in, within a time limit, and read its result.

The program runs in its own process group, which is terminated as a whole, because Webots starts further processes.
Failures of the program are returned as outcomes, not raised.
"""

import json
import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from pipeline.files import atomic
from pipeline.webots.booster_lab import RESULT_MARK
from pipeline.webots.project import Project, run_plan
from pipeline.webots.result import MAX_CHARACTERS, ResultError, WalkResult, WebotsSettings, parse_result

WEBOTS_FLAGS = ("--batch", "--mode=fast", "--no-rendering", "--minimize", "--stdout", "--stderr")
WEBOTS_NOT_FOUND = "webots not found"
FINISHED, NOT_RUN = "finished", "not run"
NO_START, TIMED_OUT, CRASHED = "did not start", "timed out", "crashed"
NO_RESULT, GARBAGE, STALE = "no result", "garbage", "stale result"
PORT_TRIES = 3
TAKEN = ("address already in use", "could not listen", "port is already")
"""Lower-case messages of a program whose port is not free."""
GRACE_S = 3.0
"""Time between SIGTERM and SIGKILL [s]."""
TAIL_CHARACTERS = 2000


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a launch."""

    status: str
    """`finished`, with a result; `not run` if the program is missing; else how it failed to run."""
    reason: str = ""
    """Reason as a message; empty if it finished."""
    result: WalkResult | None = None
    tail: str = ""
    """The end of the program's output."""


def find_webots(environment: Mapping[str, str] = os.environ) -> Path | None:
    """The program, on the path or in the folder `WEBOTS_HOME`; None if missing."""
    home = environment.get("WEBOTS_HOME")
    found = shutil.which("webots", path=environment.get("PATH")) or (home and shutil.which("webots", path=home))
    return Path(found) if found else None


def launch_webots(project: Project, settings: WebotsSettings) -> Outcome:
    """Run the project in Webots, under a virtual display if there is none, its controller in this Python."""
    program = find_webots()
    if program is None:
        return Outcome(status=NOT_RUN, reason=WEBOTS_NOT_FOUND)
    atomic.write_text(project.controller / "runtime.ini", f"[python]\nCOMMAND = {sys.executable}\n")
    display = shutil.which("xvfb-run") if not os.environ.get("DISPLAY") else None
    before = [] if display is None else [display, "-a"]
    return launch([*before, str(program)], project, settings)


def launch(
    program: Sequence[str], project: Project, settings: WebotsSettings, environment: Mapping[str, str] | None = None
) -> Outcome:
    """Run the project in `program`, which takes Webots' flags; retry on another port if the port is taken."""
    outcome = Outcome(status=NO_START, reason="it was not tried")
    for _ in range(PORT_TRIES):
        command = [*program, *WEBOTS_FLAGS, f"--port={free_port()}", str(project.world.resolve())]
        outcome = _try(command, project, settings, environment)
        printed = outcome.tail.lower()
        if outcome.status == FINISHED or not any(each in printed for each in TAKEN):
            break
    return outcome


def free_port() -> int:
    """A currently free port."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def _try(
    command: list[str], project: Project, settings: WebotsSettings, environment: Mapping[str, str] | None
) -> Outcome:
    run = secrets.token_hex(8)
    project.result.unlink(missing_ok=True)
    atomic.write_text(project.run, json.dumps(run_plan(settings, run), indent=1) + "\n")
    with tempfile.TemporaryFile() as output:
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=project.folder,
                env={**os.environ, **(environment or {})},
                start_new_session=True,
            )
        except OSError as error:
            return Outcome(status=NO_START, reason=f"{command[0]}: {error.strerror}")
        try:
            exit_status: int | None = process.wait(settings.limit_s)
        except subprocess.TimeoutExpired:
            exit_status = None
        finally:
            end_group(process)
        return _outcome(exit_status, _text(output), project, settings, run)


def _outcome(exit_status: int | None, printed: str, project: Project, settings: WebotsSettings, run: str) -> Outcome:
    """The outcome: a valid result counts even if the program failed afterwards; else the first failure."""
    tail = printed[-TAIL_CHARACTERS:]
    text = _result_text(project, printed)
    status, reason = NO_RESULT, "it ended without a result"
    if text is not None:
        try:
            names = tuple(segment.name for segment in settings.segments)
            return Outcome(status=FINISHED, result=parse_result(text, run, names), tail=tail)
        except ResultError as error:
            status, reason = STALE if error.stale else GARBAGE, str(error)
    if exit_status is None:
        status, reason = TIMED_OUT, f"it was terminated after {settings.limit_s:g} s"
    elif exit_status < 0 and text is None:
        status, reason = CRASHED, f"it was killed by {_signal_name(-exit_status)}"
    elif exit_status > 0 and text is None:
        last = tail.strip().splitlines()[-1:] or ["nothing printed"]
        status, reason = CRASHED, f"it ended with status {exit_status}: {last[0]}"
    return Outcome(status=status, reason=reason, tail=tail)


def _result_text(project: Project, printed: str) -> str | None:
    """The result file, or the printed result line if the file is missing."""
    if project.result.is_file():
        with project.result.open(encoding="utf-8", errors="replace") as file:
            return file.read(MAX_CHARACTERS + 1)
    lines = [line for line in printed.splitlines() if RESULT_MARK in line]
    return lines[-1].partition(RESULT_MARK)[2] if lines else None


def _signal_name(number: int) -> str:
    """Name such as `SIGABRT`; most real-time signals have none."""
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"


def _text(output: IO[bytes]) -> str:
    """The end of the output, long enough for a result."""
    output.seek(max(output.seek(0, os.SEEK_END) - 2 * MAX_CHARACTERS, 0))
    return output.read().decode("utf-8", errors="replace")


def end_group(process: subprocess.Popen) -> None:
    """End a process group: SIGTERM first, then SIGKILL."""
    for order in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, order)
        except (ProcessLookupError, PermissionError):
            break
        try:
            process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            continue
    process.wait()
