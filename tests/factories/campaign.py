"""One mutated input in a process of its own: the verdict, and the memory that the process took."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

RIGHT, REFUSED, WRONG, CRASHED, CAPPED = "right", "refused", "silent wrong", "crashed", "capped"
LEAST_CAP_MB, FILE_FACTOR, FILE_CAP_MB = 1_000.0, 4.0, 200.0
"""A process may take 1 GB on top of its parent's, or 200 MB and four times the size of the file."""
ADDRESS_SPACE = 6 << 30
"""Bytes that a process may map on top of its parent's; beyond that an allocation fails."""
MOST_CPU_S = 120


@dataclass(frozen=True)
class Verdict:
    """The result of one mutated input."""

    kind: str
    """`right`, `refused`, `silent wrong`, `crashed` or `capped`."""
    text: str = ""
    """Sentence of a refusal, reason of a fault."""
    size: int = 0
    """Bytes of the file."""
    peak_mb: float = 0.0
    """Largest resident memory of the process on top of what it began with, its parent's libraries [MB]."""


@dataclass(frozen=True)
class Case:
    """One mutated input."""

    name: str
    run: Callable[[Path], Verdict]
    """Writes the input into the folder that it is given, reads it with the product and compares."""


def memory_cap_mb(size: int) -> float:
    """Memory that reading a file of so many bytes may take [MB]."""
    return max(LEAST_CAP_MB, FILE_CAP_MB + FILE_FACTOR * size / 1e6)


def run_isolated(case: Case) -> Verdict:
    """Run a case in a child process with limits on memory and processor time."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        _child(case, write)
    os.close(write)
    with os.fdopen(read, "rb") as stream:
        content = stream.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status) or not content:
        number = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        return Verdict(CRASHED, f"ended by {signal.Signals(number).name if number else 'itself'}")
    verdict = Verdict(**json.loads(content))
    if verdict.kind != CRASHED and verdict.peak_mb > memory_cap_mb(verdict.size):
        return Verdict(CAPPED, f"{verdict.peak_mb:.0f} MB of memory", verdict.size, verdict.peak_mb)
    return verdict


def _child(case: Case, write: int) -> None:
    """Answer through the pipe and end; never returns."""
    base_kb = int(_status("VmRSS"))
    try:
        mapped = int(_status("VmSize")) * 1024 + ADDRESS_SPACE
        resource.setrlimit(resource.RLIMIT_AS, (mapped, mapped))
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_CPU_S, MOST_CPU_S))
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        with tempfile.TemporaryDirectory() as folder:
            verdict = case.run(Path(folder))
    except MemoryError:
        verdict = Verdict(CAPPED, "MemoryError")
    except BaseException:
        verdict = Verdict(CRASHED, traceback.format_exc()[-1500:])
    answer = {**asdict(verdict), "peak_mb": max(int(_status("VmHWM")) - base_kb, 0) / 1024.0}
    with os.fdopen(write, "wb") as stream:
        stream.write(json.dumps(answer).encode())
    sys.stdout.flush()
    os._exit(0)


def _status(key: str) -> str:
    """A figure of this process [kB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(line.split()[1] for line in lines if line.startswith(f"{key}:"))


def is_sentence(text: str, name: str) -> bool:
    """Whether a refusal is one readable line that names the file."""
    return name in text and "\n" not in text.strip() and "Traceback" not in text and 10 < len(text) < 10_000
