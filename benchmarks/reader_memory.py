"""Peak memory of reading a large file of each format in a separate process; bound: 200 MB + 4 times its size.

Run: python -m benchmarks.reader_memory [--megabytes 50] [--format bvh ...] [--json]

The first bar is a BVH of 149 MB. Archives and logs are written without compression; the size of a
compressed one is its uncompressed size.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.large_motions import WRITERS, write_large
from benchmarks.report import Bar, machine, report

ROOT = Path(__file__).resolve().parent.parent
LARGE_BVH_MB = 149.0
FIXED_MB, TIMES = 200.0, 4.0
"""Memory bound of a reader: a fixed part [MB], and a multiple of the file's size."""

CHILD = """
import sys
from pathlib import Path
from pipeline.readers import Statement, read_motion
fps = float(sys.argv[2])
stated = Statement(fps=fps or None, quaternion="xyzw" if "gmr" in sys.argv[1] else None)
found = read_motion(Path(sys.argv[1]), "clip", stated)
status = Path("/proc/self/status").read_text()
print(found.clip.frame_count, next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])
"""


def peak_mb(path: Path, fps: float = 0.0) -> tuple[int, float]:
    """Read a motion file in a separate process; return its frames and the peak resident memory [MB] (Linux)."""
    command = [sys.executable, "-c", CHILD, str(path), str(fps)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{path.name}: {done.stderr.strip().splitlines()[-1]}")
    frames, peak_kb = done.stdout.split()
    return int(frames), float(peak_kb) * 1024.0 / 1e6


def bars_of(name: str, megabytes: float, folder: Path) -> list[Bar]:
    """Peak memory and time of one format, from a file of about `megabytes`."""
    path = write_large(name, megabytes, folder)
    size_mb = path.stat().st_size / 1e6
    start = time.perf_counter()
    frames, peak = peak_mb(path, 50.0 if name in ("csv", "qpos npz") else 0.0)
    took = time.perf_counter() - start
    path.unlink()
    label = f"{name}, {size_mb:.0f} MB, {frames} frames"
    return [
        Bar(name=f"{label}: peak memory", value=peak, unit="MB", sense="<=", bound=FIXED_MB + TIMES * size_mb),
        Bar(name=f"{label}: time with start", value=took, unit="s"),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description="Peak memory of reading a large file of each format.")
    parser.add_argument("--megabytes", type=float, default=50.0, help="size of the files of all formats (default: 50)")
    parser.add_argument("--format", nargs="+", choices=sorted(WRITERS), default=list(WRITERS), help="these alone")
    parser.add_argument("--json", action="store_true", help="print one object")
    parsed = parser.parse_args()
    bars: list[Bar] = []
    with tempfile.TemporaryDirectory() as name:
        if "bvh" in parsed.format:
            bars += bars_of("bvh", LARGE_BVH_MB, Path(name))
        for each in parsed.format:
            bars += bars_of(each, parsed.megabytes, Path(name))
    return 0 if report(bars, machine=machine(), json=parsed.json) else 1


if __name__ == "__main__":
    sys.exit(main())
