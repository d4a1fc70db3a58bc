"""Read a log of the robot, damaged or not: python examples/read_robot_log.py LOG.mcap."""

import sys
import tempfile
from pathlib import Path

import numpy as np

from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, ingest, layouts, read_trial
from pipeline.robot import load_robot

path = Path(sys.argv[1])
values = settings.read(Path("data/hardware_logs.yaml"), LogSettings)

with tempfile.TemporaryDirectory() as folder:
    # A log becomes one trial or several, each a Parquet file on a regular time base.
    found = ingest(
        path, path.stem, Path(folder), layouts=layouts([load_robot("t1"), load_robot("k1")]), settings=values
    )
    print(f"{path}: {found.integrity}, {found.messages} messages")
    for note in found.notes:
        print(f"  {note}")
    for entry in found.trials:
        trial = read_trial(entry.path)
        tilt_deg = np.degrees(np.arccos(np.clip(-trial.gravity_b[trial.measured, 2], -1.0, 1.0)))
        fell = bool((trial.fall_state >= 1).any())
        print(f"  {trial.name}: {trial.seconds:.1f} s at {trial.rate_hz:g} Hz, largest tilt {tilt_deg.max():.1f} deg")
        print(f"  command {np.nanmax(np.abs(trial.command)):.2f} at most, fall reported: {'yes' if fell else 'no'}")
