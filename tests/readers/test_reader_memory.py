"""Memory of reading: below 200 MB and four times the file's size, for every format (benchmarks/reader_memory.py)."""

import sys

import numpy as np
import pytest

from benchmarks.large_motions import WRITERS
from benchmarks.reader_memory import FIXED_MB, TIMES, bars_of
from pipeline.files import page_memory

SIZE_MB = 5.0
TOGETHER_MB = 25.0
"""What rows that are worked on together take, whatever the size of the file."""


@pytest.fixture(scope="module")
def start_mb(tmp_path_factory):
    """Peak memory of a process that reads a file of 0.1 MB."""
    return bars_of("bvh", 0.1, tmp_path_factory.mktemp("start"))[0].value


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
@pytest.mark.parametrize("name", WRITERS)
def test_reading_takes_no_more_than_four_times_the_files_size(tmp_path, start_mb, name):
    peak = bars_of(name, SIZE_MB, tmp_path)[0].value
    assert peak <= FIXED_MB + TIMES * SIZE_MB
    assert peak - start_mb <= TIMES * SIZE_MB + TOGETHER_MB


@pytest.mark.parametrize("form", [lambda array: array, lambda array: array.view("<f4"), lambda array: array[3:]])
def test_rows_that_were_used_give_their_memory_back_and_others_stay(form):
    array = page_memory.empty((100_000, 8))
    array[:] = 1.0
    part = form(array)
    page_memory.forget(part, 50_000)
    page = 4096 // part.strides[0] + 1
    assert not part[page : 50_000 - page].any()
    assert np.array_equal(part[50_000:], np.ones((100_000, 8)).view(part.dtype)[array.shape[0] - len(part) + 50_000 :])


def test_arrays_that_are_not_of_pages_keep_what_they_hold():
    for array in (np.ones((100_000, 8)), page_memory.empty((10, 3)) + 1.0, page_memory.empty((90_000, 4)).T):
        before = array.copy()
        page_memory.forget(array, len(array))
        np.testing.assert_array_equal(array, before)
