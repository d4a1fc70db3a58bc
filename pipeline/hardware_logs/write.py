"""Write a robot's log as MCAP in the format of `ros2 bag record -s mcap`; equal messages give equal bytes."""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from pipeline.files import atomic
from pipeline.hardware_logs.log_facts import to_metadata
from pipeline.hardware_logs.messages import ENCAPSULATION, TOPICS, payload_dtype, schema_name, schema_text
from pipeline.hardware_logs.robot_log import METADATA, FallStates, LowCmds, LowStates, Odometry, RobotLog

LIBRARY = "booster-lab"
QOS = {"offered_qos_profiles": ""}
"""Metadata of each channel."""


@dataclass(frozen=True, kw_only=True)
class Storage:
    """Storage options of the recorder; by default those of rosbag2's preset `zstd_small`."""

    compression: str = "zstd"
    """`zstd`, `lz4` or nothing."""
    chunk_bytes: int = 786_432
    """Size at which a chunk is closed; 0 writes messages without chunks."""
    chunk_crc: bool = True


ZSTD_SMALL = Storage()


def open_writer(stream: io.BytesIO, storage: Storage) -> Writer:
    """Start an MCAP file as `ros2 bag record` does."""
    writer = Writer(
        stream,
        chunk_size=storage.chunk_bytes,
        compression=CompressionType[storage.compression.upper() or "NONE"],
        use_chunking=storage.chunk_bytes > 0,
        enable_crcs=storage.chunk_crc,
    )
    writer.start("ros2", LIBRARY)
    return writer


def open_channel(writer: Writer, topic: str) -> int:
    """Register a channel with schema for one of `TOPICS`; return its id."""
    message = TOPICS[topic]
    schema = writer.register_schema(schema_name(message), "ros2msg", schema_text(message).encode())
    return writer.register_channel(topic, "cdr", schema, QOS)


COMM_HZ = 500
"""Rate of the motors' communication [Hz], `reserve[1]`."""
SERIAL = 1
"""`cmd_type` of joint commands."""


def write_mcap(path: Path, log: RobotLog, storage: Storage = ZSTD_SMALL) -> None:
    """Write a log atomically. Equal logs give equal bytes."""
    atomic.write_bytes(path, mcap_bytes(log, storage))


def mcap_bytes(log: RobotLog, storage: Storage = ZSTD_SMALL) -> bytes:
    """The bytes of a log's MCAP file: metadata record, then all messages in the order of receipt."""
    stream = io.BytesIO()
    writer, topics = open_writer(stream, storage), payloads(log)
    start_ns = min(int(time_ns[0]) for time_ns, _ in topics.values() if len(time_ns))
    writer.add_metadata(METADATA, to_metadata(log.facts, start_ns))
    channels = [open_channel(writer, topic) for topic in topics]
    rows = [values.view(f"V{values.dtype.itemsize}") for _, values in topics.values()]
    times = [time_ns for time_ns, _ in topics.values()]
    which = np.repeat(np.arange(len(times)), [len(each) for each in times])
    row = np.concatenate([np.arange(len(each)) for each in times])
    every = np.concatenate(times)
    order = np.argsort(every, kind="stable")
    for topic, index, time_ns in zip(which[order].tolist(), row[order].tolist(), every[order].tolist(), strict=True):
        writer.add_message(channels[topic], time_ns, rows[topic][index].tobytes(), time_ns, index)
    writer.finish()
    return stream.getvalue()


def payloads(log: RobotLog) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Topic -> receipt times and payloads."""
    found = {"/low_state": (log.low_state.time_ns, low_states(log.low_state))}
    if log.joint_ctrl is not None:
        found["/joint_ctrl"] = (log.joint_ctrl.time_ns, _low_cmds(log.joint_ctrl))
    if log.fall_down is not None:
        found["/fall_down"] = (log.fall_down.time_ns, _fall_states(log.fall_down))
    if log.odometer is not None:
        found["/odometer_state"] = (log.odometer.time_ns, _odometry(log.odometer))
    return found | log.further


def _empty(message: str, length: int, *counts: int) -> np.ndarray:
    values = np.zeros(length, dtype=payload_dtype(message, *counts))
    values["encapsulation"] = np.void(ENCAPSULATION)
    return values


def low_states(states: LowStates) -> np.ndarray:
    """Payloads of `/low_state`."""
    count = states.joint_pos.shape[1]
    values = _empty("LowState", len(states.time_ns), count, count)
    imu = values["imu_state"]
    imu["rpy"], imu["gyro"], imu["acc"] = states.rpy, states.gyro_b, states.acc_b
    for name in ("serial", "parallel"):  # the motors get the joints' values as well
        values[f"motor_state_{name}_count"] = count
        motors = values[f"motor_state_{name}"]
        motors["mode"] = 1
        motors["q"], motors["dq"], motors["ddq"] = states.joint_pos, states.joint_vel, states.joint_acc
        motors["tau_est"], motors["temperature"], motors["lost"] = states.torque_est, states.temperature_c, states.lost
        motors["reserve"][..., 1] = COMM_HZ
    return values


def _low_cmds(commands: LowCmds) -> np.ndarray:
    count = commands.target_pos.shape[1]
    values = _empty("LowCmd", len(commands.time_ns), count)
    values["cmd_type"], values["motor_cmd_count"] = SERIAL, count
    motors = values["motor_cmd"]
    motors["q"], motors["tau"] = commands.target_pos, commands.target_torque
    motors["kp"], motors["kd"], motors["weight"] = commands.kp, commands.kd, 1.0
    return values


def _fall_states(falls: FallStates) -> np.ndarray:
    values = _empty("FallDownState", len(falls.time_ns))
    values["fall_down_state"], values["is_recovery_available"] = falls.state, falls.recovery_available
    return values


def _odometry(odometry: Odometry) -> np.ndarray:
    values = _empty("Odometer", len(odometry.time_ns))
    values["x"], values["y"], values["theta"] = odometry.pose.T
    return values
