"""Progress of long commands: on stderr, first at once, last when all is done, and the results as they are."""

import re

import pytest

from pipeline.batch import reporting_pool
from pipeline.batch.reporting_pool import ReportingPool


def double(number: int) -> int:
    return 2 * number


@pytest.mark.parametrize("backend", ["sequential", "loky"])
def test_the_results_are_those_of_the_pool_and_progress_is_on_stderr(capsys, monkeypatch, backend):
    monkeypatch.setattr(reporting_pool, "EVERY_S", 0.0)
    pool = ReportingPool(backend=backend, workers=2, what="halves done")
    assert list(pool.map(double, [(1,), (2,), (3,)])) == [2, 4, 6]
    printed = capsys.readouterr()
    assert printed.out == ""
    lines = printed.err.splitlines()
    assert lines[0] == "halves done: 0 of 3"
    assert [re.match(r"halves done: (\d) of 3", line)[1] for line in lines] == ["0", "1", "2", "3"]
    assert "left" in lines[1] and "left" not in lines[-1]


def test_quick_work_prints_no_line_for_each_call(capsys):
    list(ReportingPool(backend="sequential", what="done").map(double, [(number,) for number in range(50)]))
    assert len(capsys.readouterr().err.splitlines()) == 2
