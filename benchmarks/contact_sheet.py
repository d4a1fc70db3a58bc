"""Least processor time of five contact sheets of a human and a robot: `benchmarks/contact_sheet.py [--json]`."""

from __future__ import annotations

import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.robot import load_robot  # noqa: E402
from pipeline.viewing.contact_sheet import LARGE, contact_sheet  # noqa: E402
from pipeline.viewing.playlist import Shown  # noqa: E402
from tests.factories.figures import gliding_human, tumbling_robot  # noqa: E402

TIMES = 5
MOST_S = 0.5


def main() -> int:
    robot = load_robot("t1")
    shown = [Shown(name="walk", human=gliding_human(), robot_clip=tumbling_robot(robot))]
    contact_sheet(shown, robot, dots_per_m=LARGE)
    took_s = []
    for _ in range(TIMES):
        started = time.process_time()
        contact_sheet(shown, robot, dots_per_m=LARGE)
        took_s.append(time.process_time() - started)
    bar = Bar(name="a sheet of two clips", value=min(took_s), unit="s", sense="<=", bound=MOST_S)
    return 0 if report([bar], machine=machine(), json="--json" in sys.argv[1:]) else 1


if __name__ == "__main__":
    raise SystemExit(main())
