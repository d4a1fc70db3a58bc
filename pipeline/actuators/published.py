"""`published_curves.csv`: a manufacturer's peak curves for comparison only."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import FileError
from pipeline.files.csv_text import csv_records, read_csv_text

TABLE = "published_curves.csv"
COLUMNS = ("model", "peak_torque [N m]", "knee_speed [rad/s]", "no_load_speed [rad/s]")


@dataclass(frozen=True, kw_only=True)
class PublishedCurve:
    """Constant torque up to a knee speed, then linear to 0; constant if the knee is above the no-load speed."""

    peak_torque: float
    """[N m]"""
    knee_speed: float
    """[rad/s]"""
    no_load_speed: float
    """[rad/s]"""

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """(speed, torque) of the curve's corners."""
        knee = min(self.knee_speed, self.no_load_speed)
        return ((0.0, self.peak_torque), (knee, self.peak_torque), (self.no_load_speed, 0.0))

    def torque(self, speed: float) -> float:
        """Torque [N m] at a speed [rad/s]."""
        if speed <= min(self.knee_speed, self.no_load_speed):
            return self.peak_torque
        if speed >= self.no_load_speed:
            return 0.0
        return self.peak_torque * (self.no_load_speed - speed) / (self.no_load_speed - self.knee_speed)


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
