"""A database is written and judged a clip at a time: what is kept of each are names, numbers and reasons."""

import tracemalloc
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from pipeline.expert import ExpertEntry, check_database, read_database, write_database
from pipeline.robot import Robot
from tests.factories.robot_clips import wandering

FEW, MANY, FRAMES = 2, 12, 400
FRAME_BYTES = 79 * 8
STAGES = {"stages": [{"stage": "repair", "parameters": {str(number): number for number in range(1000)}}]}
"""Text of 14 kB, the same for every clip."""


def _entries(robot: Robot, count: int) -> Iterator[ExpertEntry]:
    clip = wandering(robot, seed=1, seconds=FRAMES / 50.0)
    for index in range(count):
        own = clip.cut(0, clip.frame_count, f"source/clip{index:02d}")
        yield ExpertEntry(clip=own, weight=1.0, skill="walk", licence="MIT", stages=STAGES)


def _peak(work: Callable[[], object]) -> int:
    """Most bytes allocated at a time by `work()` over what was there before."""
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        kept = work()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
        del kept


@pytest.fixture(scope="module")
def folders(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Databases of few and of many clips."""
    made = {count: tmp_path_factory.mktemp("databases") / "t1" for count in (FEW, MANY)}
    for count, folder in made.items():
        write_database(folder, _entries(robot, count), robot, stages={})
    return made


def test_writing_keeps_neither_frames_nor_a_text_for_each_clip(robot: Robot, tmp_path: Path):
    peaks = {
        count: _peak(lambda count=count: write_database(tmp_path / "t1", _entries(robot, count), robot, stages={}))
        for count in (FEW, MANY)
    }
    assert (peaks[MANY] - peaks[FEW]) / (MANY - FEW) < 0.05 * FRAMES * FRAME_BYTES


def test_judging_keeps_no_frames(folders: dict[int, Path]):
    judged, read = (
        [_peak(partial(function, folders[count])) for count in (FEW, MANY)]
        for function in (check_database, read_database)
    )
    assert (judged[1] - judged[0]) / (MANY - FEW) < 0.05 * FRAMES * FRAME_BYTES
    assert (read[1] - read[0]) / (MANY - FEW) > 0.9 * FRAMES * FRAME_BYTES, "that is how much there is to keep"


def test_judging_says_what_reading_says(folders: dict[int, Path]):
    read, judged = read_database(folders[MANY]), check_database(folders[MANY])
    assert judged.manifest == read.manifest
    assert judged.index.equals(read.index)
    assert len(judged.index) == len(read.clips) == MANY
