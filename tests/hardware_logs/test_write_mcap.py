"""Logs that we write are MCAP files that others read, with every value."""

import io

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.hardware_logs import ZSTD_SMALL, Storage, mcap_bytes, write_mcap
from pipeline.hardware_logs.messages import BUTTONS, MESSAGES, TOPICS, schema_name, schema_text
from tests.factories.mcap_writer import FASTWRITE, ZSTD_FAST
from tests.factories.robot_logs import POLICY, START_NS, STICKS, robot_log


def typestore():
    store, types = get_typestore(Stores.ROS2_HUMBLE), {}
    for message in TOPICS.values():
        types |= get_types_from_msg(schema_text(message), schema_name(message))
    store.register(types)
    return store


def read_by_rosbags(path):
    """Messages of each topic as rosbags reads them."""
    store, found = typestore(), {}
    with Reader(path) as reader:
        for connection, time_ns, raw in reader.messages():
            message = store.deserialize_cdr(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((time_ns, message))
    return found


def test_rosbags_reads_every_field_that_was_written(robot, tmp_path):
    log = robot_log(robot, 0.5)
    write_mcap(tmp_path / "walk.mcap", log)
    found = read_by_rosbags(tmp_path / "walk.mcap")
    states = [message for _, message in found["/low_state"]]
    assert [time for time, _ in found["/low_state"]] == log.low_state.time_ns.tolist()
    for name, source in (("rpy", log.low_state.rpy), ("gyro", log.low_state.gyro_b), ("acc", log.low_state.acc_b)):
        np.testing.assert_array_equal([getattr(each.imu_state, name) for each in states], source.astype(np.float32))
    motors = {
        "q": log.low_state.joint_pos,
        "dq": log.low_state.joint_vel,
        "ddq": log.low_state.joint_acc,
        "tau_est": log.low_state.torque_est,
        "temperature": log.low_state.temperature_c,
        "lost": log.low_state.lost,
    }
    for arrays in ("motor_state_serial", "motor_state_parallel"):
        for name, source in motors.items():
            read = np.array([[getattr(motor, name) for motor in getattr(each, arrays)] for each in states])
            np.testing.assert_array_equal(read, source.astype(np.float32))
    commands = [message for _, message in found["/joint_ctrl"]]
    read = np.array([[[m.q, m.tau, m.kp, m.kd] for m in each.motor_cmd] for each in commands])
    ctrl = log.joint_ctrl
    written = np.stack([ctrl.target_pos, ctrl.target_torque, ctrl.kp, ctrl.kd], axis=-1).astype(np.float32)
    np.testing.assert_array_equal(read, written)
    assert {each.cmd_type for each in commands} == {1}
    assert [each.fall_down_state for _, each in found["/fall_down"]] == log.fall_down.state.tolist()
    read = [[each.x, each.y, each.theta] for _, each in found["/odometer_state"]]
    np.testing.assert_array_equal(read, log.odometer.pose.astype(np.float32))
    remote = [each for _, each in found["/remote_controller_state"]]
    _, written = log.further["/remote_controller_state"]
    for name in (*STICKS, *BUTTONS):
        assert [getattr(each, name) for each in remote] == written[name].tolist()


@pytest.mark.parametrize("storage", [ZSTD_SMALL, ZSTD_FAST, FASTWRITE, Storage(compression="lz4", chunk_bytes=50_000)])
def test_the_reference_reader_finds_all_messages_checksums_and_facts(robot, storage):
    log = robot_log(robot, 1.0)
    reader = make_reader(io.BytesIO(mcap_bytes(log, storage)), validate_crcs=True)
    times = [message.log_time for _, _, message in reader.iter_messages()]
    assert times == sorted(times)
    assert times[0] == START_NS
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics.message_count == len(times) == 500 + 50 + 10 + 50 + 20
    assert summary.statistics.message_end_time == times[-1]
    assert {channel.topic for channel in summary.channels.values()} == set(TOPICS)
    (metadata,) = reader.iter_metadata()
    assert metadata.name == "booster_lab"
    assert metadata.metadata["policy_digest"] == POLICY
    assert metadata.metadata["simulated"] == "yes"


def test_the_same_log_gives_the_same_bytes(robot):
    assert mcap_bytes(robot_log(robot, 0.2)) == mcap_bytes(robot_log(robot, 0.2))


def test_payloads_have_the_size_that_was_published(robot):
    from pipeline.hardware_logs.messages import payload_dtype

    assert payload_dtype("LowState", 23, 23).itemsize == 1704
    assert set(MESSAGES) >= set(TOPICS.values())
