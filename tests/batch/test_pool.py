"""Worker processes end with the process that started them, whatever ended it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

SCRIPT = """
import os, time
from pathlib import Path
from pipeline.batch import ClipPool
from tests.batch.test_pool import work
list(ClipPool(workers=2).map(work, [({folder!r}, number) for number in range(2)]))
"""


def work(folder: str, number: int) -> None:
    """Note the process, then work for longer than the test lasts."""
    (Path(folder) / f"{os.getpid()}").touch()
    time.sleep(120.0)


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_for(condition, seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not condition():
        time.sleep(0.1)
    return condition()


def test_workers_end_when_their_parent_is_killed(tmp_path, root):
    parent = subprocess.Popen([sys.executable, "-c", SCRIPT.format(folder=str(tmp_path))], cwd=root)
    try:
        assert wait_for(lambda: len(list(tmp_path.iterdir())) == 2, 120.0), "no workers"
        workers = [int(path.name) for path in tmp_path.iterdir()]
        assert all(map(alive, workers))
        os.kill(parent.pid, signal.SIGKILL)
        parent.wait()
        assert wait_for(lambda: not any(map(alive, workers)), 20.0)
    finally:
        parent.kill()
