"""Metadata counts wherever it is in a log: a simulated log is never taken for a real one."""

import dataclasses

import numpy as np
import pytest

from pipeline.files import settings
from pipeline.hardware_logs import LogError, LogSettings, Storage, ingest, layouts, mcap_bytes, read_trial
from pipeline.hardware_logs.log_facts import to_metadata
from pipeline.hardware_logs.messages import TOPICS, schema_name, schema_text
from pipeline.hardware_logs.robot_log import METADATA
from pipeline.hardware_logs.write import payloads
from tests.factories.mcap_writer import FASTWRITE, McapWriter
from tests.factories.robot_logs import POLICY, START_NS, facts, robot_log

STORAGES = {"chunks": Storage(chunk_bytes=60_000), "no chunks": FASTWRITE}


def with_metadata_last(log, storage: Storage, *metadata: dict[str, str]) -> bytes:
    """The log's messages topic by topic, then metadata records."""
    writer = McapWriter(storage)
    topics = payloads(log)
    channels = [writer.channel(topic, schema_name(TOPICS[topic]), schema_text(TOPICS[topic])) for topic in topics]
    rows = [
        (int(time_ns), channel, values[index].tobytes())
        for channel, (times, values) in zip(channels, topics.values(), strict=True)
        for index, time_ns in enumerate(times.tolist())
    ]
    for time_ns, channel, data in sorted(rows, key=lambda row: row[0]):
        writer.message(channel, time_ns, data)
    for values in metadata:
        writer.metadata(METADATA, values)
    return writer.finish()


@pytest.fixture
def read(root, robot, tmp_path):
    """Trials and notes of a log, and whether anything is left behind."""

    def read(data: bytes):
        path, out = tmp_path / "log.mcap", tmp_path / "out"
        path.write_bytes(data)
        values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
        made = ingest(path, "log", out, layouts=layouts([robot]), settings=values)
        assert sorted(out.iterdir()) == sorted(trial.path for trial in made.trials)
        return [read_trial(trial.path) for trial in made.trials]

    return read


@pytest.mark.parametrize("storage", STORAGES)
def test_metadata_after_the_messages_counts_as_metadata_before_them(robot, read, storage):
    log = robot_log(robot, 1.5)
    (first,) = read(mcap_bytes(log, STORAGES[storage]))
    (last,) = read(with_metadata_last(log, STORAGES[storage], to_metadata(log.facts, START_NS)))
    assert last.simulated
    assert last.policy_digest == POLICY
    assert last.events == first.events
    np.testing.assert_array_equal(last.command, first.command)
    np.testing.assert_array_equal(last.joint_pos, first.joint_pos)


def test_metadata_records_that_contradict_each_other_refuse_the_log(robot, read):
    log = robot_log(robot, 0.5)
    real = to_metadata(facts(simulated=False), START_NS)
    with pytest.raises(LogError, match="metadata records 'booster_lab' contradict each other"):
        read(with_metadata_last(log, STORAGES["chunks"], real, to_metadata(log.facts, START_NS)))
    (trial,) = read(with_metadata_last(log, STORAGES["chunks"], *2 * [to_metadata(log.facts, START_NS)]))
    assert trial.simulated


def test_a_log_without_metadata_is_of_a_robot(robot, read):
    (trial,) = read(with_metadata_last(dataclasses.replace(robot_log(robot, 0.5)), STORAGES["chunks"]))
    assert not trial.simulated
    assert trial.policy_digest is None
