"""`curves.csv`: of a resumed run the rows before the checkpoint stay, `nan` in a new column; a full disk."""

from pathlib import Path

import pytest

from pipeline.errors import FileError
from pipeline.learning.curves_file import CurvesFile


def test_a_resumed_run_keeps_the_rows_before_its_checkpoint(tmp_path: Path):
    path = tmp_path / "curves.csv"
    first = CurvesFile(path, 0)
    assert first.seconds == 0.0
    for iteration in (1, 2, 3):
        first.add({"iteration": iteration, "seconds": 0.5 * iteration, "loss": 1.0 / 3.0})
    first.write()
    assert path.read_text() == "iteration,seconds,loss\n1,0.5,0.33333\n2,1,0.33333\n3,1.5,0.33333\n"

    resumed = CurvesFile(path, 2)
    assert resumed.seconds == 1.0
    resumed.add({"iteration": 3, "seconds": 1.75, "loss": 0.25, "falls": 2.0})
    resumed.write()
    rows = ["1,0.5,0.33333,nan", "2,1,0.33333,nan", "3,1.75,0.25,2"]
    assert path.read_text().splitlines() == ["iteration,seconds,loss,falls", *rows]
    assert [each.name for each in tmp_path.iterdir()] == ["curves.csv"]


def full(monkeypatch):
    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pipeline.files.atomic.os.fsync", refuse)


def test_a_full_disk_gets_one_sentence(tmp_path: Path, monkeypatch):
    curves = CurvesFile(tmp_path / "curves.csv", 0)
    curves.add({"iteration": 1, "seconds": 1.0})
    full(monkeypatch)
    with pytest.raises(FileError, match=r"curves\.csv: could not be written \(.*No space left on device"):
        curves.write()
    assert not list(tmp_path.iterdir())
