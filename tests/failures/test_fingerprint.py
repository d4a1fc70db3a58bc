"""Logs of the virtual robot that are torn, split, stored otherwise or another walk, from files to what is counted."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.failures.find import find_failures
from pipeline.failures.signals import UNKNOWN, fingerprint_of, windows_of
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.trust import without_copies
from pipeline.hardware_logs import RobotLog, write_mcap
from pipeline.hardware_logs.write import Storage
from pipeline.virtual_robot.scripted import TOPPLE_LEFT
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import FAILURES, scripted_log, trials_in

TRIAL = VirtualTrial(command=((0.5, 0.0, 0.4, 0.0),), seconds=4.0)
SMALL_CHUNKS = Storage(chunk_bytes=100_000)


@pytest.fixture(scope="module")
def log(robot):
    return scripted_log(robot, TOPPLE_LEFT, TRIAL, seed=1)


@pytest.fixture
def reports(robot, actuators, tmp_path):
    """The reports of a log file's trials."""

    def made(path: Path) -> list[TrialReport]:
        return [find_failures(each, robot, actuators, FAILURES, file=path.name) for each in trials_in(path, robot)]

    return made


@pytest.fixture
def whole(log, tmp_path):
    path = tmp_path / "whole.mcap"
    write_mcap(path, log, SMALL_CHUNKS)
    return path


def _counted(*reports: TrialReport) -> int:
    return len({each.recording for each in without_copies(reports)[0]})


def _part(log: RobotLog, start_s: float, stop_s: float) -> RobotLog:
    """What was received in a span of time since the first message."""
    first = int(log.low_state.time_ns[0])
    topics = {}
    for name in ("low_state", "joint_ctrl", "fall_down", "odometer"):
        topic = getattr(log, name)
        inside = (topic.time_ns >= first + start_s * 1e9) & (topic.time_ns < first + stop_s * 1e9)
        rows = {key: each[inside] for key, each in vars(topic).items() if isinstance(each, np.ndarray)}
        topics[name] = dataclasses.replace(topic, **rows)
    return dataclasses.replace(log, **topics)


@pytest.mark.parametrize("share", [0.999, 0.9, 0.6])
def test_a_torn_copy_is_of_the_same_recording(whole, reports, share, tmp_path):
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
    (one,), (other,) = reports(whole), reports(torn)
    assert one.whole and not other.whole and one.sha256 != other.sha256
    assert _counted(one, other) == 1
    heard, _ = without_copies([other, one])
    assert {each.report.file for each in heard if each.report.failures} == {"whole.mcap"}


def test_a_copy_with_a_hole_agrees_where_it_is_whole(whole, reports, tmp_path):
    data = bytearray(whole.read_bytes())
    middle = int(0.4 * len(data))
    data[middle : middle + 1000] = bytes(1000)
    holed = tmp_path / "holed.mcap"
    holed.write_bytes(data)
    (one,), several = reports(whole), reports(holed)
    known = windows_of(one.fingerprint, one.start_ns)
    found = [windows_of(each.fingerprint, each.start_ns) for each in several]
    assert 0 < sum(len(each) for each in found) < len(known)
    assert all(each.items() <= known.items() for each in found)
    assert _counted(one, *several) == 1


@pytest.mark.parametrize("storage", [Storage(compression="lz4"), Storage(compression="", chunk_bytes=50_000)])
def test_a_copy_that_is_stored_otherwise_is_of_the_same_recording(log, whole, reports, storage, tmp_path):
    other = tmp_path / "other.mcap"
    write_mcap(other, log, storage)
    (one,), (again,) = reports(whole), reports(other)
    assert one.sha256 != again.sha256 and one.fingerprint == again.fingerprint
    assert _counted(one, again) == 1


def test_the_files_of_a_split_bag_are_one_recording_with_and_without_the_whole(log, whole, reports, tmp_path):
    pieces = []
    for number, (start_s, stop_s) in enumerate(((0.0, 1.7), (1.7, 9.0))):
        path = tmp_path / f"bag_{number}.mcap"
        write_mcap(path, _part(log, start_s, stop_s))
        pieces += reports(path)
    assert len(pieces) == 2 and _counted(*pieces) == 1
    assert _counted(*pieces, *reports(whole)) == 1


def test_another_simulated_walk_is_another_recording_though_it_begins_at_the_same_moment(
    robot, whole, reports, tmp_path
):
    other = tmp_path / "other.mcap"
    write_mcap(other, scripted_log(robot, TOPPLE_LEFT, TRIAL, seed=2))
    (one,), (another,) = reports(whole), reports(other)
    assert one.start_ns == another.start_ns and one.policy == another.policy
    assert _counted(one, another) == 2


def test_a_window_that_a_trial_has_not_whole_is_not_known(standing):
    later = dataclasses.replace(standing, start_ns=standing.start_ns + 100_000_000)
    prints = fingerprint_of(later)
    assert prints.startswith(UNKNOWN) and not prints.startswith(2 * UNKNOWN)
    assert fingerprint_of(standing)[:8] != UNKNOWN
    changed = standing.joint_pos.copy()
    changed[700, 3] += np.float32(1e-6)
    had, has = (
        windows_of(fingerprint_of(each), standing.start_ns)
        for each in (standing, dataclasses.replace(standing, joint_pos=changed))
    )
    differing = [each for each in had if had[each] != has[each]]
    assert differing == [standing.start_ns // 500_000_000 + 2]
