"""A log becomes trials: attributed, with its command and events in time, within bounds, with one error type."""

import dataclasses
import sqlite3

import numpy as np
import pytest
from mcap.opcode import Opcode

from pipeline.files import settings
from pipeline.hardware_logs import (
    LogError,
    LogSettings,
    Storage,
    Trial,
    ingest,
    layouts,
    mcap_bytes,
    read_trial,
    write_mcap,
)
from pipeline.hardware_logs.log_report import Bounds
from pipeline.hardware_logs.mcap_records import RECORD_HEAD
from pipeline.hardware_logs.missed_bars import MissedBar, note_of
from pipeline.robot import load_robot
from tests.factories.mcap_writer import FASTWRITE
from tests.factories.robot_logs import START_NS, facts, low_states, robot_log, sticks_and_buttons


@pytest.fixture
def read(root, robot, tmp_path):
    """Ingest a log; its trials."""

    def read(data, **options) -> list[Trial]:
        path = tmp_path / "log.mcap"
        path.write_bytes(data) if isinstance(data, bytes) else write_mcap(path, data)
        values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
        made = ingest(
            path, "log", tmp_path / "out", layouts=layouts([robot, load_robot("k1")]), settings=values, **options
        )
        return [read_trial(trial.path) for trial in made.trials]

    return read


def test_the_schedule_is_the_command(robot, read):
    (trial,) = read(robot_log(robot, 1.5))
    np.testing.assert_array_equal(trial.command[trial.time_s < 1.0], 0.0)
    np.testing.assert_array_equal(trial.command[trial.time_s >= 1.0], np.tile([0.5, -0.25, 0.125], (250, 1)))


def test_a_log_in_pieces_does_not_say_in_which_of_them_it_missed_a_bar(robot, read):
    slip = MissedBar(cell="vx +0.6", figure="slip", got=0.2, asked=0.1, from_s=0.5, until_s=1.0)
    log = robot_log(robot, 1.0, facts=facts(notes=note_of((slip,))))
    (whole,) = read(log)
    assert whole.missed == (slip,)
    late = log.low_state.time_ns + np.where(np.arange(500) < 250, 0, 3_000_000_000)
    pieces = read(dataclasses.replace(log, low_state=dataclasses.replace(log.low_state, time_ns=late)))
    assert len(pieces) == 2
    for each in pieces:
        assert each.missed == () and any("in which of its 2 trials" in note for note in each.notes)


def test_sticks_are_the_command_where_the_log_says_so(robot, read):
    said = facts(command_source="remote", command=(), command_scale=(1.0, 0.5, 2.0))
    (trial,) = read(robot_log(robot, 1.0, facts=said))
    np.testing.assert_allclose(trial.command, np.tile([1.0, 0.25, -0.5], (500, 1)))
    assert trial.command_source == "remote"


def test_no_source_is_no_command(robot, read):
    (trial,) = read(robot_log(robot, 1.0, facts=facts(command_source="unknown", command=()), further={}))
    assert np.isnan(trial.command).all()


def test_events_of_people_are_in_the_trials_time(robot, read):
    (trial,) = read(robot_log(robot, 1.0))
    found = [(event.kind, round(event.time_s, 6), event.source) for event in trial.events]
    assert found == [("button back", 0.5, "remote"), ("held", 0.5, "metadata"), ("released", 0.75, "metadata")]


def test_a_button_that_stays_down_is_one_event(robot, read):
    buttons = np.zeros((20, 12), dtype=np.int64)
    buttons[[3, 4, 5, 9]] = 1
    times = START_NS + np.arange(20) * 50_000_000
    (trial,) = read(robot_log(robot, 1.0, further=sticks_and_buttons(times, np.zeros((20, 4)), buttons)))
    pressed = [event.time_s for event in trial.events if event.kind == "button a"]
    np.testing.assert_allclose(pressed, [0.15, 0.45])


def test_twenty_two_joints_are_a_k1(robot, read):
    waist = robot.joint("Waist")
    states = low_states(robot, START_NS + np.arange(500) * 2_000_000)
    arrays = {
        name: np.delete(value, waist, axis=1)
        for name, value in vars(states).items()
        if isinstance(value, np.ndarray) and value.shape[1:] == (23,)
    }
    k1 = load_robot("k1")
    middle = 0.5 * (k1.joint_lower + k1.joint_upper)
    states = dataclasses.replace(states, **{**arrays, "joint_pos": np.tile(middle, (500, 1))})
    (trial,) = read(robot_log(robot, 1.0, facts=facts(robot="k1"), low_state=states, joint_ctrl=None))
    assert (trial.robot, trial.joint_names) == ("k1", k1.joint_names)
    with pytest.raises(LogError, match="stated to be of 't1', but 22 joints are those of 'k1'"):
        read(robot_log(robot, 1.0, low_state=states, joint_ctrl=None))


def test_a_checksum_of_the_whole_verifies_what_has_none_of_its_own(robot, read):
    import zlib

    data = bytearray(mcap_bytes(robot_log(robot, 0.5), FASTWRITE))
    at = data.index(RECORD_HEAD.pack(Opcode.DATA_END, 4))
    data[at + 9 : at + 13] = zlib.crc32(bytes(data[:at])).to_bytes(4, "little")
    (trial,) = read(bytes(data))
    assert trial.integrity == "complete"
    data[at // 2] ^= 1
    (trial,) = read(bytes(data))
    assert trial.integrity == "unverified"
    assert "the checksum of all messages is wrong" in trial.notes[0]


def test_an_error_tells_file_byte_and_messages(robot, read):
    with pytest.raises(LogError, match=r"log.mcap: not an MCAP file: .* \(at byte 0, 0 messages read\)") as caught:
        read(b"nothing of that kind")
    assert (caught.value.offset, caught.value.recovered) == (0, 0)


@pytest.mark.parametrize(
    ("bounds", "says"),
    [
        ({"messages": 100}, "more than 100 messages"),
        ({"total_bytes": 100_000}, "more than 100000 bytes after inflation"),
        ({"chunks": 3}, "more than 3 chunks"),
    ],
)
def test_bounds_are_kept(robot, read, monkeypatch, bounds, says):
    for name, value in bounds.items():
        monkeypatch.setattr(Bounds, name, value)
    data = mcap_bytes(robot_log(robot, 1.0), Storage(chunk_bytes=60_000))
    with pytest.raises(LogError, match=says) as caught:
        read(data)
    assert caught.value.recovered > 0


def test_a_refused_log_leaves_nothing(robot, read, tmp_path):
    said = facts(robot="k1")
    with pytest.raises(LogError, match="stated to be of 'k1'"):
        read(robot_log(robot, 10.0, facts=said))
    assert not list((tmp_path / "out").rglob("*"))


@pytest.mark.parametrize(
    "script",
    [
        "CREATE TABLE other(id)",
        "CREATE TABLE topics(id, name, type, serialization_format); CREATE VIEW messages AS WITH RECURSIVE "
        "r(id, topic_id, timestamp, data) AS (SELECT 1, 1, 1, x'00' UNION ALL SELECT id + 1, 1, id, x'00' FROM r) "
        "SELECT * FROM r",
    ],
)
def test_a_database_that_is_no_bag_is_refused(root, robot, tmp_path, script):
    with sqlite3.connect(tmp_path / "log.db3") as base:
        base.executescript(script)
    values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
    with pytest.raises(LogError, match="it has no tables 'topics' and 'messages'"):
        ingest(tmp_path / "log.db3", "log", tmp_path / "out", layouts=layouts([robot]), settings=values)


def test_the_same_log_gives_the_same_bytes(root, robot, tmp_path):
    values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
    (tmp_path / "log.mcap").write_bytes(mcap_bytes(robot_log(robot, 1.0)))
    made = [
        ingest(tmp_path / "log.mcap", "log", tmp_path / name, layouts=layouts([robot]), settings=values)
        for name in "ab"
    ]
    one, other = (each.trials[0].path.read_bytes() for each in made)
    assert one == other


def test_of_two_robots_with_as_many_joints_the_stated_one_is_taken(root, robot, tmp_path):
    other = dataclasses.replace(robot, name="t9")
    values = settings.read(root / "data/hardware_logs.yaml", LogSettings)

    def robot_of(log) -> str:
        path = tmp_path / "log.mcap"
        write_mcap(path, log)
        known = layouts([robot, other])
        return ingest(path, "log", tmp_path / "out", layouts=known, settings=values).trials[0].numbers["robot"]

    log = robot_log(robot, 1.0, joint_ctrl=None)
    assert robot_of(dataclasses.replace(log, facts=facts(robot="t9"))) == "t9"
    assert robot_of(log) == "t1"
    with pytest.raises(LogError, match="23 joints are those of 't1' and 't9'; state the robot"):
        robot_of(dataclasses.replace(log, facts=facts(robot="")))
