"""What `benchmarks/process_tree.py` counts of processes that end before they are listed."""

import os
import sys
from pathlib import Path

from benchmarks.process_tree import watch

CHILDREN, SPENT_S = 6, 0.1
CHILD = f"import time\nwhile time.process_time() < {SPENT_S}: pass"
PARENT = f"""import subprocess, sys, time
for _ in range({CHILDREN}):
    subprocess.run([sys.executable, "-S", "-c", {CHILD!r}], check=True)
time.sleep(0.5)
"""


def test_processor_time_of_short_lived_processes_is_counted(tmp_path: Path):
    command = [sys.executable, "-c", PARENT]
    watched = watch(command, folder=tmp_path, environment=os.environ, log=tmp_path / "log")
    assert watched.cpu_s >= CHILDREN * SPENT_S
    assert watched.samples[-1].cpu_s >= CHILDREN * SPENT_S, "the parent has waited for all of them by then"
    assert watched.cpu_s >= watched.samples[-1].cpu_s - 0.02, "the kernel's clock ticks at 100 Hz"
    times_s = [sample.cpu_s for sample in watched.samples]
    assert times_s == sorted(times_s)
