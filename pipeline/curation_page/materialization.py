"""Runs of `dagster asset materialize` that the page starts, one at a time, with their progress.

A run can also compute given clips again from the first stage; `Rerun` compares their results before and after.
"""

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
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch.again import AGAIN_VARIABLE
from pipeline.curation_page.clip_details import ancestors
from pipeline.curation_page.clip_table import DATABASE, STAGES, ClipRow, ClipTable, NoClipError, asset_of
from pipeline.errors import PipelineError
from pipeline.files import digest

LINES = 300
"""Number of output lines to keep."""

_PROGRESS = re.compile(r"(\w+): (\d+) of (\d+) clips")
_STAGE = re.compile(r"(\w+): (\d+) clips, (\d+) known, (\d+) to work on")
_TIME = re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d [+-]\d{4} - dagster - (INFO|DEBUG|WARNING|ERROR) - ")


class Materialization:
    """A run of `dagster asset materialize` in the project's folder. `state` may be called from any thread."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._lines: deque[str] = deque(maxlen=LINES)
        self._stage: dict[str, Any] = {}
        self._started_s = 0.0
        self._runs = 0
        self._stopped = False

    def start(self, *assets: str, again: Sequence[str] = ()) -> None:
        """Start a run that materializes assets. Raises PipelineError if a run is in progress.

        Args:
            assets: keys of the assets
            again: clips that every stage processes again although their results are cached
        """
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                raise PipelineError("a run is already in progress; wait until it ends.")
            scripts = str(Path(sys.executable).parent)
            environment = {**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ.get('PATH', '')}"}
            environment.pop(AGAIN_VARIABLE, None)
            clip_file = _clip_file(again) if again else None
            if clip_file is not None:
                environment[AGAIN_VARIABLE] = str(clip_file)
            self._lines.clear()
            self._stage = {}
            self._stopped = False
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
            threading.Thread(target=self._follow, args=(self._process, clip_file), daemon=True).start()

    def stop(self) -> None:
        """Terminate the run and its child processes, if one is in progress."""
        with self._lock:
            if self._process is not None and self._process.poll() is None:
                self._stopped = True  # before the signal, because `state` reads it without the lock
                os.killpg(self._process.pid, signal.SIGTERM)

    def state(self) -> dict[str, Any]:
        """State of the run: in progress (`at_work`), exit status, `stopped` by a person, stage, last output lines."""
        process = self._process
        status = process.poll() if process is not None else None
        return {
            "run": self._runs,
            "at_work": process is not None and status is None,
            "status": status,
            "stopped": self._stopped,
            "seconds": round(time.monotonic() - self._started_s, 1) if process is not None and status is None else None,
            "stage": dict(self._stage),
            "lines": list(self._lines),
        }

    def _follow(self, process: subprocess.Popen[str], clip_file: Path | None) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            text = line.rstrip("\n")
            if text.strip():
                self._lines.append(_TIME.sub("", text)[:500])
                self._stage = stage_of_line(text, self._stage, time.monotonic())
        process.wait()
        if clip_file is not None:
            clip_file.unlink(missing_ok=True)


def _clip_file(clips: Sequence[str]) -> Path:
    """Write clip names to a temporary file for the run."""
    handle, name = tempfile.mkstemp(prefix="booster_lab_again_", suffix=".json")
    with os.fdopen(handle, "w") as stream:
        json.dump(list(clips), stream)
    return Path(name)


def stage_of_line(text: str, stage: dict[str, Any], now_s: float) -> dict[str, Any]:
    """Update the current stage from a line of output.

    Args:
        text: line of output
        stage: stage before the line: name, number of clips done and in total, estimated remaining time [s]
        now_s: time of the line, by a monotonic clock [s]
    """
    if match := _STAGE.search(text):
        return {"name": match[1], "done": 0, "of": int(match[4]), "known": int(match[3]), "since_s": now_s}
    if match := _PROGRESS.search(text):
        name, done, of = match[1], int(match[2]), int(match[3])
        since_s = stage.get("since_s", now_s) if stage.get("name") == name else now_s
        left_s = (now_s - since_s) / done * (of - done) if done else None
        more = {"left_s": round(left_s)} if left_s is not None else {}
        return {**stage, "name": name, "done": done, "of": of, "since_s": since_s, **more}
    return stage


UNCHANGED, CHANGED, GONE = "unchanged", "changed", "gone"
MAX_NAMES = 20
"""Maximum number of clip names per kind in an outcome."""


@dataclass(frozen=True, kw_only=True)
class Rerun:
    """Clips to process again, with their previous results."""

    before: Mapping[str, str]
    """Clip -> digest of its previous result."""
    names: tuple[str, ...]
    """The clips and their ancestors, which the stages process again."""
    assets: tuple[str, ...]
    """Assets to materialize, upstream first."""

    def outcome(self, table: ClipTable) -> dict[str, Any]:
        """Compare with the results in a table: number and names of the unchanged, changed and missing clips."""
        found: dict[str, list[str]] = {UNCHANGED: [], CHANGED: [], GONE: []}
        results = _results(table, self.before)
        for clip, before in self.before.items():
            after = results.get(clip)
            found[GONE if after is None else UNCHANGED if after == before else CHANGED].append(clip)
        return {
            "clips": len(self.before),
            **{kind: {"count": len(clips), "clips": clips[:MAX_NAMES]} for kind, clips in found.items()},
        }


def rerun_of(table: ClipTable, clips: Iterable[str], robot: str) -> Rerun:
    """Rerun of clips from the recording to the robot's database. Raises NoClipError."""
    rows = []
    for clip in dict.fromkeys(clips):
        row = table.row(clip)
        if row is None:
            raise NoClipError(clip)
        rows.append(row)
    if not rows:
        raise NoClipError("")
    made_from = {name for row in rows for name in ancestors(row)}
    known = {judged.clip for manifest in table.manifests.values() for judged in manifest.judged}
    return Rerun(
        before=_results(table, [row.clip for row in rows]),
        names=tuple(sorted(made_from & known)),
        assets=tuple(asset_of(stage, robot) for stage in (*STAGES, DATABASE)),
    )


def _results(table: ClipTable, clips: Iterable[str]) -> dict[str, str]:
    """Clip -> digest of its last stage, reasons, figures and motions. Clips without a row are left out."""
    rows = {clip: row for clip in clips if (row := table.row(clip)) is not None}
    pieces = {name for row in rows.values() for name in (row.clip, *row.pieces)}
    blobs: dict[str, list[str]] = {}
    for manifest in table.manifests.values():
        for entry in manifest.entries:
            if entry.clip in pieces:
                blobs.setdefault(entry.clip, []).append(entry.blob)
    return {clip: _digest(row, blobs) for clip, row in rows.items()}


def _digest(row: ClipRow, blobs: Mapping[str, list[str]]) -> str:
    figures = {
        name: value for name, value in row.numbers.items() if name != "weight"
    }  # a weight depends on all other clips
    motions = [blobs.get(name, []) for name in (row.clip, *row.pieces)]
    return digest.of_json([row.stage, row.verdict, list(map(dict, row.reasons)), list(row.pieces), figures, motions])
