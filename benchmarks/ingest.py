"""Speed and memory of log ingest, and results for 300 damaged logs.

    python benchmarks/ingest.py [--minutes 10] [--json]

A log of ten minutes at 500 Hz, with commands at 50 Hz and at 500 Hz, is ingested by one process on one core: read,
checked, decoded, made regular, written as Parquet. Memory is the process's peak over what it had with all libraries
loaded. Each is done three times and the fastest counts, because other programs use the machine.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.hardware_logs import Trial, read_trial, write_mcap  # noqa: E402
from pipeline.robot import load_robot  # noqa: E402
from tests.factories.damaged_logs import damaged_logs, write_all  # noqa: E402
from tests.factories.robot_logs import noisy_log, robot_log  # noqa: E402
from tests.factories.wrong_values import EXACT, wrong_values  # noqa: E402

SEED = 8
RUNS = 3
LOGS = {"commands at 50 Hz": 50.0, "commands at 500 Hz": 500.0}


def ingested(folder: Path) -> tuple[list[dict], dict]:
    """Ingest each log of a folder in a separate process; return its results and its memory."""
    worker = [sys.executable, str(ROOT / "benchmarks/ingest_worker.py"), str(folder), str(folder.parent / "out")]
    done = subprocess.run(worker, capture_output=True, text=True, check=True)
    *each, process = map(json.loads, done.stdout.splitlines())
    return each, process


def speed_bars(minutes: float, folder: Path) -> list[Bar]:
    """Messages per second, and memory of long logs compared with short ones."""
    robot, bars = load_robot("t1"), []
    for name, command_hz in LOGS.items():
        peaks, speeds = [], []
        for part in (0.1, 1.0):
            logs = folder / f"{command_hz:g}_{part}"
            logs.mkdir(parents=True)
            rng = np.random.default_rng(SEED)
            write_mcap(logs / "log.mcap", noisy_log(robot, 60.0 * minutes * part, command_hz, rng))
            found = [ingested(logs) for _ in range(RUNS)]
            speeds = [each["messages"] / each["cpu_s"] for (each,), _ in found]
            peaks.append(min(process["peak_mb"] - process["before_mb"] for _, process in found))
        bars += [
            Bar(name=f"{name}: messages a second of one core", value=max(speeds), unit="1/s", sense=">=", bound=80_000),
            Bar(name=f"{name}: memory, {0.1 * minutes:g} min", value=peaks[0], unit="MB"),
            Bar(name=f"{name}: memory, {minutes:g} min", value=peaks[1], unit="MB", sense="<=", bound=200.0),
            Bar(name=f"{name}: growth", value=peaks[1] - peaks[0], unit="MB", sense="<=", bound=50.0),
        ]
    return bars


def clean_trial(folder: Path, seconds: float) -> Trial:
    """Trial of the undamaged log."""
    (folder / "clean").mkdir(parents=True)
    write_mcap(folder / "clean/clean.mcap", robot_log(load_robot("t1"), seconds))
    (each,), _ = ingested(folder / "clean")
    return read_trial(Path(each["trials"][0]))


def damage_bars(each: int, folder: Path) -> list[Bar]:
    """Silently wrong data, marks, messages and memory over `each` files of ten kinds of damage."""
    seconds = 2.0
    logs = damaged_logs(load_robot("t1"), SEED, each, seconds)
    paths = write_all(folder / "logs", logs)
    said, process = ingested(folder / "logs")
    by_name = {one["file"]: one for one in said}
    clean = clean_trial(folder, seconds)
    wrong = unmarked = unanswered = 0
    for log, path in zip(logs, paths, strict=True):
        answer = by_name[path.name]
        trials = [read_trial(Path(trial)) for trial in answer["trials"]]
        if log.kind in (*EXACT, "clock"):
            wrong += any(wrong_values(trial, clean, log) for trial in trials)
        unmarked += any(trial.integrity != "unverified" for trial in trials) and not log.checked
        unanswered += bool(trials) == bool(answer["refused"]) or "\n" in answer["refused"]
    return [
        Bar(name="damaged logs", value=float(len(logs)), sense=">=", bound=300),
        Bar(name="damaged: silent wrong data", value=float(wrong), unit="logs", sense="<=", bound=0),
        Bar(name="damaged: without checksums and not marked", value=float(unmarked), unit="logs", sense="<=", bound=0),
        Bar(name="damaged: without a sentence or trials", value=float(unanswered), unit="logs", sense="<=", bound=0),
        Bar(name="damaged: refused", value=float(sum(bool(one["refused"]) for one in said)), unit="logs"),
        Bar(name="damaged: memory of the process", value=process["peak_mb"], unit="MB", sense="<=", bound=1_000),
        Bar(name="damaged: longest", value=max(one["cpu_s"] for one in said), unit="s"),
    ]


def main() -> int:
    """Print the table; 0 when all bars hold."""
    parser = argparse.ArgumentParser(description="Speed and memory of the ingest of logs; 300 damaged ones.")
    parser.add_argument("--minutes", type=float, default=10.0, help="length of the long log")
    parser.add_argument("--each", type=int, default=30, help="files of each of the ten kinds of damage")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bars = [*speed_bars(arguments.minutes, folder / "speed"), *damage_bars(arguments.each, folder / "damage")]
    return 0 if report(bars, machine=machine(), json=arguments.json) else 1


if __name__ == "__main__":
    sys.exit(main())
