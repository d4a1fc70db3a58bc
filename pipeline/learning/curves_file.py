"""`curves.csv`: one row an iteration of a training run."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path


class CurvesFile:
    """`curves.csv`, whole after every row. A resumed run keeps the rows before its checkpoint."""

    def __init__(self, path: Path, before: int):
        self._path = path
        rows = list(csv.DictReader(path.read_text().splitlines())) if path.is_file() else []
        self._rows = [row for row in rows if int(row["iteration"]) <= before]
        self.seconds = float(self._rows[-1]["seconds"]) if self._rows else 0.0
        """Seconds of training that the kept rows stand for."""

    def add(self, row: Mapping[str, float]) -> None:
        """Put a row at the end."""
        texts = {name: str(value) if isinstance(value, int) else f"{value:.5g}" for name, value in row.items()}
        self._rows.append(texts)

    def write(self) -> None:
        """Replace the file by all rows."""
        if not self._rows:
            return
        stream = io.StringIO()
        writer = csv.DictWriter(stream, fieldnames=list(self._rows[-1]), restval="nan", lineterminator="\n")
        writer.writeheader()
        writer.writerows(self._rows)
        part = self._path.with_suffix(".part")
        part.write_text(stream.getvalue())
        part.replace(self._path)
