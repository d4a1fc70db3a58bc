"""`curves.csv`: one row an iteration of a training run."""

import csv
from collections.abc import Mapping
from pathlib import Path

from pipeline.files import atomic


class CurvesFile:
    """`curves.csv`, whole after every write. A resumed run keeps the rows before its checkpoint."""

    def __init__(self, path: Path, before: int):
        self._path = path
        rows = list(csv.DictReader(path.read_text().splitlines())) if path.is_file() else []
        kept = [row for row in rows if int(row["iteration"]) <= before]
        self._names = list(kept[0]) if kept else []
        self._lines = [",".join(row.values()) for row in kept]
        self.seconds = float(kept[-1]["seconds"]) if kept else 0.0
        """Seconds of training that the kept rows stand for."""

    def add(self, row: Mapping[str, float]) -> None:
        """Put a row at the end; columns are those of the newest row, with `nan` in rows that lack one."""
        if list(row) != self._names:
            known = [dict(zip(self._names, line.split(","), strict=True)) for line in self._lines]
            self._names = list(row)
            self._lines = [",".join(each.get(name, "nan") for name in self._names) for each in known]
        self._lines.append(",".join(str(value) if isinstance(value, int) else f"{value:.5g}" for value in row.values()))

    def write(self) -> None:
        """Replace the file by all rows. Raises FileError where the disk refuses."""
        if not self._lines:
            return
        atomic.write_text(self._path, "\n".join([",".join(self._names), *self._lines, ""]))
