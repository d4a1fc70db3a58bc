"""Which files of the folder are logs, and which of them are complete."""

import os
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.hardware_logs import mcap_bytes
from pipeline.hardware_logs.log_folder import (
    QUIET_S,
    STALE_S,
    complete_logs,
    is_complete,
    is_whole,
    list_logs,
    names_of,
    packed_files,
)
from tests.factories.damaged_logs import bag_bytes
from tests.factories.robot_logs import robot_log

NOW_S = 1_000_000.0


@pytest.fixture(scope="module")
def logs() -> dict[str, bytes]:
    """A small log by suffix."""
    from pipeline.robot import load_robot

    log = robot_log(load_robot("t1"), 0.2)
    return {".mcap": mcap_bytes(log), ".db3": bag_bytes(log)}


def put(path, data: bytes, age_s: float = 0.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    os.utime(path, (NOW_S - age_s, NOW_S - age_s))
    return path


@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.999])
def test_a_part_of_a_log_is_not_whole(logs, tmp_path, suffix, share):
    data = logs[suffix]
    assert is_whole(put(tmp_path / f"whole{suffix}", data))
    assert not is_whole(put(tmp_path / f"part{suffix}", data[: int(share * len(data))]))


def test_a_bag_with_a_journal_is_still_written(logs, tmp_path):
    bag = put(tmp_path / "bag.db3", logs[".db3"])
    put(tmp_path / "bag.db3-wal", b"")
    assert not is_whole(bag)


def test_whole_files_wait_a_moment_and_others_a_minute(logs, tmp_path):
    data = logs[".mcap"]
    for age_s, whole, part in (
        (0.0, False, False),
        (QUIET_S + 1.0, True, False),
        (STALE_S - 1.0, True, False),
        (STALE_S + 1.0, True, True),
        (-3_600.0, False, False),
    ):
        assert is_complete(put(tmp_path / "whole.mcap", data, age_s), NOW_S) is whole
        assert is_complete(put(tmp_path / "part.mcap", data[:-100], age_s), NOW_S) is part


def test_a_copy_with_the_time_of_a_robot_whose_clock_is_ahead_does_not_wait_for_it(logs, tmp_path):
    now_s = time.time()
    path = put(tmp_path / "ahead.mcap", logs[".mcap"])
    os.utime(path, (now_s + 86_400.0, now_s + 86_400.0))
    assert not is_complete(path, now_s)
    assert is_complete(path, time.time() + QUIET_S + 1.0)


def test_only_logs_are_listed(logs, tmp_path):
    for name in (
        "b/x.mcap",
        "a.db3",
        "quarantine/y.mcap",
        ".copying/z.mcap",
        ".hidden.mcap",
        "note.yaml",
        "c.db3.zstd",
    ):
        put(tmp_path / name, logs[".mcap"])
    assert [path.relative_to(tmp_path).as_posix() for path in list_logs(tmp_path)] == ["a.db3", "b/x.mcap"]
    assert [path.name for path in packed_files(tmp_path)] == ["c.db3.zstd"]
    assert list_logs(tmp_path / "nowhere") == packed_files(tmp_path / "nowhere") == []


def test_logs_of_one_name_keep_their_suffixes(logs, tmp_path):
    for suffix, data in logs.items():
        put(tmp_path / f"logs/walk{suffix}", data, 100.0)
    put(tmp_path / "logs/walk.yaml", b"robot: t1\n")
    found, waiting = complete_logs(tmp_path / "logs", tmp_path / "digests.json", NOW_S)
    assert [log.name for log in found] == ["walk.db3", "walk.mcap"]
    assert all(log.sidecar is not None for log in found)
    assert waiting == []


NAMES = {
    "walk.mcap": "walk",
    "walk+2.mcap": "walk+2.mcap",
    "walk+two.mcap": "walk+two",
    "day+2/walk.mcap": "day+2/walk",
    "run.db3": "run.db3",
    "run.mcap": "run.mcap",
    "run.mcap.mcap": "run.mcap.mcap",
    "+2.mcap": "+2.mcap",
}


def test_a_name_is_of_one_log_and_of_no_further_trial_of_another():
    assert names_of([Path(name) for name in NAMES]) == list(NAMES.values())


@given(st.sets(st.from_regex(r"(a/)?[ab+2]{1,3}(\+[12]){0,2}(\.mcap|\.db3){1,2}", fullmatch=True), max_size=30))
def test_whatever_logs_are_called_their_trials_have_names_of_their_own(files):
    names = names_of([Path(file) for file in sorted(files)])
    trials = [trial for name in names for trial in (name, *(f"{name}+{number}" for number in range(2, 23)))]
    assert len(set(trials)) == len(trials)
