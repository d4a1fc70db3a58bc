"""`curves.csv`: one row per iteration of a training run."""

import csv
from collections.abc import Mapping
from pathlib import Path

from pipeline.files import atomic


class CurvesFile:
    """`curves.csv`, rewritten atomically. A resumed run keeps the rows up to its checkpoint."""

    def __init__(self, path: Path, last_iteration: int):
        self._path = path
        rows = list(csv.DictReader(path.read_text().splitlines())) if path.is_file() else []
        kept = [row for row in rows if int(row["iteration"]) <= last_iteration]
        self._names = list(kept[0]) if kept else []
        self._lines = [",".join(row.values()) for row in kept]
        self.seconds = float(kept[-1]["seconds"]) if kept else 0.0
        """Training time of the kept rows [s]."""

    def add(self, row: Mapping[str, float]) -> None:
        """Append a row. Its columns become those of the file; earlier rows get `nan` in new columns."""
        if list(row) != self._names:
            rows = [dict(zip(self._names, line.split(","), strict=True)) for line in self._lines]
            self._names = list(row)
            self._lines = [",".join(each.get(name, "nan") for name in self._names) for each in rows]
        self._lines.append(",".join(str(value) if isinstance(value, int) else f"{value:.5g}" for value in row.values()))

    def write(self) -> None:
        """Write all rows. Raises FileError if the file can't be written."""
        if not self._lines:
            return
        atomic.write_text(self._path, "\n".join([",".join(self._names), *self._lines, ""]))
