"""Ingest the logs of a folder in a separate process; print the result of each, and the memory.

python benchmarks/ingest_worker.py FOLDER OUT
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import pyarrow  # noqa: E402

from pipeline.files import settings  # noqa: E402
from pipeline.hardware_logs import LogError, LogSettings, ingest, layouts  # noqa: E402
from pipeline.robot import load_robot  # noqa: E402


def peak_mb() -> float:
    """Peak resident memory of this program; the system's counter would include the parent process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    (peak,) = [line.split()[1] for line in lines if line.startswith("VmHWM")]
    return float(peak) / 1024.0


def main() -> None:
    """Write one JSON object per file, then one for the process."""
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
    pyarrow.set_cpu_count(1)
    robots = layouts([load_robot("t1")])
    values = settings.read(ROOT / "data" / "hardware_logs.yaml", LogSettings)
    before = peak_mb()
    for path in sorted(folder.iterdir()):
        start, found = time.process_time(), {"file": path.name, "trials": [], "integrity": "", "refused": ""}
        try:
            made = ingest(path, path.stem, out / path.stem, layouts=robots, settings=values)
            found |= {"integrity": made.integrity, "messages": made.messages, "notes": made.notes}
            found["trials"] = [str(trial.path) for trial in made.trials]
        except LogError as error:
            found["refused"] = str(error)
        print(json.dumps({**found, "cpu_s": time.process_time() - start, "peak_mb": peak_mb()}))
    print(json.dumps({"before_mb": before, "peak_mb": peak_mb()}))


if __name__ == "__main__":
    main()
