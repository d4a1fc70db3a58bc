"""The graph's run that the page starts: one at a time, as the command a person would type, with its progress."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipeline.batch.again import AGAIN_VARIABLE
from pipeline.errors import PipelineError

LINES = 300
"""Lines of output that are kept."""

_PROGRESS = re.compile(r"(\w+): (\d+) of (\d+) clips")
_STAGE = re.compile(r"(\w+): (\d+) clips, (\d+) known, (\d+) to work on")
_TIME = re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d [+-]\d{4} - dagster - (INFO|DEBUG|WARNING|ERROR) - ")


class Materialization:
    """A run of `dagster asset materialize` in the project's folder; `state` may be asked at any time."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._lines: deque[str] = deque(maxlen=LINES)
        self._stage: dict[str, Any] = {}
        self._started_s = 0.0
        self._runs = 0

    def start(self, *assets: str, again: Sequence[str] = ()) -> None:
        """Start the run that makes some assets. Raises PipelineError when one is at work already.

        Args:
            again: clips that each stage works on again although their answers are known
        """
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                raise PipelineError("a run is at work already; wait until it has ended.")
            scripts = str(Path(sys.executable).parent)
            environment = {**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ.get('PATH', '')}"}
            environment.pop(AGAIN_VARIABLE, None)
            listed = _listed(again) if again else None
            if listed is not None:
                environment[AGAIN_VARIABLE] = str(listed)
            self._lines.clear()
            self._stage = {}
            self._started_s = time.monotonic()
            self._runs += 1
            self._process = subprocess.Popen(
                ["dagster", "asset", "materialize", "--select", ",".join(assets)],
                cwd=self._root,
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                start_new_session=True,
            )
            threading.Thread(target=self._follow, args=(self._process, listed), daemon=True).start()

    def stop(self) -> None:
        """End the run, with all its processes, if one is at work."""
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGTERM)

    def state(self) -> dict[str, Any]:
        """Whether a run is at work, how the last one ended, its stage with progress, and its last lines."""
        process = self._process
        status = process.poll() if process is not None else None
        return {
            "run": self._runs,
            "at_work": process is not None and status is None,
            "status": status,
            "seconds": round(time.monotonic() - self._started_s, 1) if process is not None and status is None else None,
            "stage": dict(self._stage),
            "lines": list(self._lines),
        }

    def _follow(self, process: subprocess.Popen[str], listed: Path | None) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            text = line.rstrip("\n")
            if text.strip():
                self._lines.append(_TIME.sub("", text)[:500])
                self._stage = stage_of_line(text, self._stage, time.monotonic())
        process.wait()
        if listed is not None:
            listed.unlink(missing_ok=True)


def _listed(clips: Sequence[str]) -> Path:
    """A file outside the project with the names of some clips, for the run to read."""
    handle, name = tempfile.mkstemp(prefix="booster_lab_again_", suffix=".json")
    with os.fdopen(handle, "w") as stream:
        json.dump(list(clips), stream)
    return Path(name)


def stage_of_line(text: str, stage: dict[str, Any], now_s: float) -> dict[str, Any]:
    """The stage at work after a line of output: its name, clips done and to do, and the time that is left [s]."""
    if match := _STAGE.search(text):
        return {"name": match[1], "done": 0, "of": int(match[4]), "known": int(match[3]), "since_s": now_s}
    if match := _PROGRESS.search(text):
        name, done, of = match[1], int(match[2]), int(match[3])
        since_s = stage.get("since_s", now_s) if stage.get("name") == name else now_s
        left_s = (now_s - since_s) / done * (of - done) if done else None
        more = {"left_s": round(left_s)} if left_s is not None else {}
        return {**stage, "name": name, "done": done, "of": of, "since_s": since_s, **more}
    return stage
