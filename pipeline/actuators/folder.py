"""Calibrate all motors in a folder of measurements, with memoized results."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.actuators.calibrate import Calibration, calibrate
from pipeline.actuators.motor_table import MOTORS, Motor, read_motors
from pipeline.actuators.settings import ActuatorSettings
from pipeline.batch import Store
from pipeline.errors import FileError
from pipeline.files import digest, settings
from pipeline.files.csv_json import MAX_BYTES, csv_records, read_csv_text

STAGE = "actuator_calibration"
"""Stage name of cached answers."""

TABLE = "published_curves.csv"
COLUMNS = ("model", "peak_torque [N m]", "knee_speed [rad/s]", "no_load_speed [rad/s]")


@dataclass(frozen=True, kw_only=True)
class PublishedCurve:
    """Constant torque [N m] up to a knee speed [rad/s], then linear to 0; constant if the knee is above the no-load
    speed [rad/s]."""

    peak_torque: float
    knee_speed: float
    no_load_speed: float

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """(speed, torque) of the curve's corners."""
        knee = min(self.knee_speed, self.no_load_speed)
        return ((0.0, self.peak_torque), (knee, self.peak_torque), (self.no_load_speed, 0.0))

    def torque(self, speed: float) -> float:
        """Torque [N m] at a speed [rad/s]."""
        speeds, torques = zip(*self.corners, strict=True)
        return float(np.interp(speed, speeds, torques))


def read_published(folder: Path) -> dict[str, PublishedCurve]:
    """Curves by motor model; empty without a table. Raises FileError."""
    path = folder / TABLE
    if not path.is_file():
        return {}
    lines = [line for line in read_csv_text(path).splitlines() if not line.startswith("#")]
    records = list(csv_records(lines, path))
    if not records or tuple(records[0]) != COLUMNS:
        raise FileError(path, "its columns are not those of published curves.", f"They must be {', '.join(COLUMNS)}.")
    try:
        return {
            model: PublishedCurve(peak_torque=float(peak), knee_speed=float(knee), no_load_speed=float(no_load))
            for model, peak, knee, no_load in records[1:]
        }
    except ValueError as error:
        raise FileError(path, f"{error}.", "Write a model and three numbers a row.") from error


TOO_LARGE = f"# more than {MAX_BYTES} bytes\n"
"""Replaces the text of a file that is too large for a sweep; it has no rows, so it is refused."""


@dataclass(frozen=True, kw_only=True)
class CalibratedFolder:
    """Calibrations of a folder of measurements."""

    motors: tuple[Motor, ...]
    calibrations: tuple[Calibration, ...]
    """One per motor, in the table's order."""
    recomputed: tuple[str, ...]
    """Motors that were calibrated now, not found in the memo."""
    unused: tuple[str, ...]
    """Files that belong to no motor of the table."""


def calibrate_folder(folder: Path, values: ActuatorSettings, version: str, store: Store) -> CalibratedFolder:
    """Calibrate each motor of `folder`; empty if the folder does not exist.

    Args:
        version: code version, part of the memo key
    Raises FileError for an unreadable motor table; an unreadable measurement file is a refusal.
    """
    if not folder.is_dir():
        return CalibratedFolder(motors=(), calibrations=(), recomputed=(), unused=())
    if not (folder / MOTORS).is_file():
        do = "It names the motors, their joints, gears and rotors; see docs/actuators.md."
        raise FileError(folder / MOTORS, "the file is missing.", do)
    motors = read_motors(folder / MOTORS, values.model)
    calibrations, recomputed = [], []
    for motor in motors:
        path = folder / f"{motor.name}.csv"
        text = _text(path)
        key = digest.of_json(["actuator", version, settings.plain(values), settings.plain(motor), text])
        answer = store.recall(key, STAGE)
        if answer is None:
            answer = {"pieces": [], "calibration": settings.plain(calibrate(text, path.name, motor, values))}
            store.remember(key, answer, STAGE)
            recomputed.append(motor.name)
        calibrations.append(Calibration.from_dict(answer["calibration"]))
    known = {MOTORS, TABLE, *(f"{motor.name}.csv" for motor in motors)}
    unused = tuple(sorted(path.name for path in folder.glob("*.csv") if path.name not in known))
    return CalibratedFolder(
        motors=motors, calibrations=tuple(calibrations), recomputed=tuple(recomputed), unused=unused
    )


def _text(path: Path) -> str | None:
    """The file's text; None without a file. Invalid UTF-8 is replaced by marks, which are refused later.

    For a file that is too large for a sweep, a text without rows, which is refused.
    """
    if not path.is_file():
        return None
    with path.open("rb") as stream:
        data = stream.read(MAX_BYTES + 1)
    return TOO_LARGE if len(data) > MAX_BYTES else data.decode("utf-8", errors="replace")
