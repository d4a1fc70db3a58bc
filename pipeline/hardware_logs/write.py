"""Write a robot's log as MCAP, as `ros2 bag record -s mcap` on the robot does: same messages, same bytes.

The official writer of the format makes the records.
"""

import io
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from pipeline.files import atomic
from pipeline.hardware_logs.log_facts import to_metadata
from pipeline.hardware_logs.messages import BUTTONS, ENCAPSULATION, TOPICS, payload_dtype, schema_name, schema_text
from pipeline.hardware_logs.robot_log import (
    METADATA,
    FallStates,
    LowCmds,
    LowStates,
    Odometry,
    RemoteStates,
    RobotLog,
)

LIBRARY = "booster-lab"


@dataclass(frozen=True, kw_only=True)
class Storage:
    """How the recorder stores: rosbag2's presets `zstd_small` (the default here), `zstd_fast`, `fastwrite`."""

    compression: str = "zstd"
    """`zstd`, `lz4` or nothing."""
    chunk_bytes: int = 786_432
    """Size at which a chunk is closed; 0 writes messages without chunks."""
    chunk_crc: bool = True


ZSTD_SMALL = Storage()
ZSTD_FAST = Storage(chunk_crc=False)
FASTWRITE = Storage(compression="", chunk_bytes=0, chunk_crc=False)


class McapWriter:
    """An MCAP file that is being written in memory: channels, messages in the order of receipt, metadata."""

    def __init__(self, storage: Storage = ZSTD_SMALL):
        self._stream, self._counts = io.BytesIO(), Counter()
        self._writer = Writer(
            self._stream,
            chunk_size=storage.chunk_bytes,
            compression=CompressionType[storage.compression.upper() or "NONE"],
            use_chunking=storage.chunk_bytes > 0,
            enable_crcs=storage.chunk_crc,
        )
        self._writer.start("ros2", LIBRARY)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """A metadata record."""
        self._writer.add_metadata(name, dict(values))

    def channel(self, topic: str, schema: str, definition: str, encoding: str = "ros2msg") -> int:
        """Open a channel with a schema of its own; its number."""
        number = self._writer.register_schema(schema, encoding, definition.encode())
        return self._writer.register_channel(topic, "cdr", number, {"offered_qos_profiles": ""})

    def message(self, channel: int, time_ns: int, payload: bytes | memoryview) -> None:
        """Append a message, received and sent at `time_ns`."""
        self._writer.add_message(channel, time_ns, bytes(payload), time_ns, self._counts[channel])
        self._counts[channel] += 1

    def finish(self) -> bytes:
        """Close the file with summary and footer; all its bytes."""
        self._writer.finish()
        return self._stream.getvalue()


SERIAL = 1
"""`cmd_type` of commands to the joints of the model."""


def write_mcap(path: Path, log: RobotLog, storage: Storage = ZSTD_SMALL) -> None:
    """Write a log, whole or not at all. Same log, same bytes."""
    atomic.write_bytes(path, mcap_bytes(log, storage))


def mcap_bytes(log: RobotLog, storage: Storage = ZSTD_SMALL) -> bytes:
    """The bytes of a log's MCAP file: its facts as metadata, then all messages in the order of their receipt."""
    writer = McapWriter(storage)
    topics = payloads(log)
    start_ns = min(int(time_ns[0]) for time_ns, _ in topics.values() if len(time_ns))
    writer.metadata(METADATA, to_metadata(log.facts, start_ns))
    channels = [writer.channel(topic, schema_name(TOPICS[topic]), schema_text(TOPICS[topic])) for topic in topics]
    times = [time_ns for time_ns, _ in topics.values()]
    parts = [values.view(np.uint8).data for _, values in topics.values()]
    sizes = [values.dtype.itemsize for _, values in topics.values()]
    which = np.repeat(np.arange(len(times)), [len(each) for each in times])
    row = np.concatenate([np.arange(len(each)) for each in times])
    every = np.concatenate(times)
    order = np.argsort(every, kind="stable")
    for topic, index, time_ns in zip(which[order].tolist(), row[order].tolist(), every[order].tolist(), strict=True):
        start = index * sizes[topic]
        writer.message(channels[topic], time_ns, parts[topic][start : start + sizes[topic]])
    return writer.finish()


def payloads(log: RobotLog) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times of receipt and payloads of each topic that the log has."""
    found = {"/low_state": (log.low_state.time_ns, low_states(log.low_state))}
    if log.joint_ctrl is not None:
        found["/joint_ctrl"] = (log.joint_ctrl.time_ns, _low_cmds(log.joint_ctrl))
    if log.fall_down is not None:
        found["/fall_down"] = (log.fall_down.time_ns, _fall_states(log.fall_down))
    if log.odometer is not None:
        found["/odometer_state"] = (log.odometer.time_ns, _odometry(log.odometer))
    if log.remote is not None:
        found["/remote_controller_state"] = (log.remote.time_ns, _remote_states(log.remote))
    return found


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
    for name, source in (("serial", states), ("parallel", states.parallel or states)):
        values[f"motor_state_{name}_count"] = count
        motors = values[f"motor_state_{name}"]
        motors["mode"] = 1
        motors["q"], motors["dq"], motors["ddq"] = source.joint_pos, source.joint_vel, source.joint_acc
        motors["tau_est"], motors["temperature"], motors["lost"] = source.torque_est, source.temperature_c, source.lost
        motors["reserve"][..., 1] = source.comm_hz
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


def _remote_states(remote: RemoteStates) -> np.ndarray:
    values = _empty("RemoteControllerState", len(remote.time_ns))
    values["lx"], values["ly"], values["rx"], values["ry"] = remote.sticks.T
    for name, pressed in zip(BUTTONS, remote.buttons.T, strict=True):
        values[name] = pressed
    values["hat_c"] = 1
    return values
