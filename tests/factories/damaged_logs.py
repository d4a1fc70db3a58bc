"""Logs with damage of every kind, from a seed: their true content is known, so that wrong data is detected."""

from __future__ import annotations

import dataclasses
import functools
import sqlite3
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode

from pipeline.hardware_logs import RobotLog, Storage, mcap_bytes
from pipeline.hardware_logs.log_facts import to_metadata
from pipeline.hardware_logs.mcap_records import CHUNK_HEAD, MAGIC, RECORD_HEAD
from pipeline.hardware_logs.messages import TOPICS, schema_name, schema_text
from pipeline.hardware_logs.robot_log import METADATA
from pipeline.hardware_logs.write import payloads
from pipeline.robot import Robot
from tests.factories.mcap_writer import FASTWRITE, ZSTD_FAST, McapWriter
from tests.factories.robot_logs import START_NS, robot_log

CHUNK_BYTES = 60_000
CHECKED = tuple(Storage(compression=kind, chunk_bytes=CHUNK_BYTES) for kind in ("zstd", "lz4", ""))
ZEROS = 200_000_000
UNCHECKED = (dataclasses.replace(ZSTD_FAST, chunk_bytes=CHUNK_BYTES), FASTWRITE)


@dataclass(frozen=True)
class Damaged:
    """A damaged file."""

    kind: str
    suffix: str
    data: bytes
    checked: bool
    """Whether it has checksums."""
    clock: Callable[[np.ndarray], np.ndarray] | None = None
    """Stamp in the file of each true time of receipt, where the clock jumps."""


@dataclass(frozen=True)
class Clean:
    """The log that is damaged, and its files."""

    log: RobotLog

    @functools.cached_property
    def files(self) -> dict[Storage, bytes]:
        return {storage: mcap_bytes(self.log, storage) for storage in (*CHECKED, *UNCHECKED)}

    @functools.cached_property
    def bag(self) -> bytes:
        return bag_bytes(self.log)


def damaged_logs(robot: Robot, seed: int, each: int, seconds: float = 1.0) -> list[Damaged]:
    """`each` files of each of ten kinds."""
    clean = Clean(log=robot_log(robot, seconds))
    kinds = (
        *(truncated, flipped, zeroed, spliced, unchecked_flipped, unchecked_bag),
        *(wrong_schema, bomb, clock_jump, implausible),
    )
    found = []
    for number, kind in enumerate(kinds):
        for index in range(each):
            found.append(kind(clean, np.random.default_rng([seed, number, index]), index))
    return found


def truncated(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    data = clean.files[CHECKED[index % 3]]
    cut = len(data) - 1 - index if index < 5 else int(rng.integers(0, len(data)))
    return Damaged("truncated", ".mcap", data[:cut], True)


def flipped(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    return Damaged("flipped", ".mcap", _flip(clean.files[CHECKED[index % 3]], rng, 1 + index % 8), True)


def zeroed(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    data = bytearray(clean.files[CHECKED[index % 3]])
    size = int(rng.choice([16, 64, 512, 4096]))
    start = int(rng.integers(0, max(len(data) - size, 1)))
    data[start : start + size] = bytes(min(size, len(data) - start))
    return Damaged("zeroed", ".mcap", bytes(data), True)


def spliced(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    """Bytes taken out, doubled, put in, or appended."""
    data = clean.files[CHECKED[index % 3]]
    one, other = sorted(rng.integers(8, len(data), size=2).tolist())
    other = min(other, one + 70_000)
    made = {
        0: data[:one] + data[other:],
        1: data[:other] + data[one:],
        2: data[:one] + rng.bytes(other - one) + data[one:],
        3: data + rng.bytes(1 + index),
    }
    return Damaged("spliced", ".mcap", made[(index // 3) % 4], True)


def unchecked_flipped(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    data = clean.files[UNCHECKED[index % 2]]
    return Damaged("unchecked", ".mcap", _flip(data, rng, index % 9) if index > 1 else data, False)


def unchecked_bag(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    data = clean.bag
    if index % 3 == 1:
        data = _flip(data, rng, 1 + index % 5)
    elif index % 3 == 2:
        data = data[: int(rng.integers(100, len(data)))]
    return Damaged("bag", ".db3", data, False)


def record(opcode: int, content: bytes) -> bytes:
    return RECORD_HEAD.pack(opcode, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def wrong_schema(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    """Another message on the topic, fields renamed or of another type, encodings we do not read, no text at all."""
    known = schema_text("LowState")
    texts = [
        (schema_name("LowState"), known.replace("motor_state_serial", "motors"), "ros2msg", "cdr"),
        (schema_name("LowState"), known.replace("float32 tau_est", "string tau_est"), "ros2msg", "cdr"),
        ("std_msgs/msg/String", "string data\n", "ros2msg", "cdr"),
        (schema_name("LowState"), "", "protobuf", "protobuf"),
        (schema_name("LowState"), "{}", "jsonschema", "json"),
        (schema_name("LowState"), rng.bytes(200).decode("latin-1"), "ros2msg", "cdr"),
        (schema_name("LowState"), known.replace("float32 q\n", "float64 q\n"), "ros2msg", "cdr"),
        (schema_name("Odometer"), schema_text("Odometer"), "ros2msg", "cdr"),
        (schema_name("LowState"), known, "ros1msg", "cdr"),
        (schema_name("LowState"), "", "", "cdr"),
    ]
    name, definition, encoding, _ = texts[index % len(texts)]
    writer = McapWriter(CHECKED[index % 3])
    channel = writer.channel("/low_state", name, definition, encoding)
    time_ns, rows = payloads(clean.log)["/low_state"]
    for stamp, row in zip(time_ns.tolist(), rows, strict=True):
        writer.message(channel, stamp, row.tobytes())
    return Damaged("schema", ".mcap", writer.finish(), True)


def bomb(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    """Chunks and records that claim or hold far more than is there."""
    stored = (
        ("zstd", 1_000, ZEROS),
        ("lz4", 1_000, ZEROS),
        ("zstd", ZEROS, ZEROS),
        ("lz4", 60_000_000, 60_000_000),
        ("zstd", 1 << 60, 100),
    )
    if index % 6 == 5:
        data = (
            MAGIC
            + record(Opcode.HEADER, text("ros2") + text(""))
            + RECORD_HEAD.pack(Opcode.CHUNK, int(rng.integers(1, 1 << 62)))
        )
        return Damaged("bomb", ".mcap", data + rng.bytes(1_000), True)
    kind, size, zeros = stored[index % 6]
    packed = compressed_zeros(kind, zeros)
    content = CHUNK_HEAD.pack(START_NS, START_NS + 1, size, 0 if index % 2 else 1) + text(kind)
    chunk = record(Opcode.CHUNK, content + len(packed).to_bytes(8, "little") + packed)
    good = clean.files[CHECKED[0]]
    place = len(MAGIC) + len(record(Opcode.HEADER, text("ros2") + text("booster-lab")))
    return Damaged("bomb", ".mcap", good[:place] + chunk * (1 + index % 3) + good[place:], True)


@functools.cache
def compressed_zeros(kind: str, size: int) -> bytes:
    """Many zeros in few bytes."""
    zeros = bytes(size)
    return zstandard.ZstdCompressor(level=3).compress(zeros) if kind == "zstd" else lz4.frame.compress(zeros)


def clock_jump(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    """The clock is set back or forward, stamps are swapped, doubled or far off; the order of receipt is true."""
    at = START_NS + int(rng.uniform(0.3, 0.7) * 1e9)
    step = int(rng.choice([-3_600, -2, 5, 86_400])) * 1_000_000_000

    def clock(true_ns: np.ndarray) -> np.ndarray:
        return np.where(true_ns >= at, true_ns + step, true_ns)

    if index % 3 == 0:
        return Damaged("clock", ".mcap", _stamped(clean.log, clock, CHECKED[index % 2]), True, clock)
    stray = rng.integers(50, 450, size=3)

    def strays(true_ns: np.ndarray) -> np.ndarray:
        stamps = true_ns.copy()
        if len(stamps) > 451:
            if index % 3 == 1:
                stamps[stray] = rng.integers(0, 1 << 63, size=3, dtype=np.uint64).view(np.int64)
            else:
                stamps[stray] = stamps[stray - 1]
        return stamps

    return Damaged("clock", ".mcap", _stamped(clean.log, strays, CHECKED[index % 2]), True)


def implausible(clean: Clean, rng: np.random.Generator, index: int) -> Damaged:
    """Numbers that are not finite, another robot, other units, far too few messages."""
    states = clean.log.low_state
    count = len(states.time_ns)
    if index % 5 == 0:
        values = states.joint_pos.copy()
        values[rng.integers(0, count, size=5), 3] = np.nan
        changed = dataclasses.replace(states, joint_pos=values)
    elif index % 5 == 1:
        changed = dataclasses.replace(states, joint_pos=np.degrees(states.joint_pos))
    elif index % 5 == 2:
        still = {name: np.zeros_like(getattr(states, name)) for name in ("gyro_b", "joint_vel")}
        changed = dataclasses.replace(states, acc_b=states.acc_b / 9.81, **still)
    elif index % 5 == 3:
        arrays = ("joint_pos", "joint_vel", "joint_acc", "torque_est", "temperature_c", "lost")
        wide = {name: np.repeat(getattr(states, name), 2, axis=1)[:, : 24 + index % 7] for name in arrays}
        changed = dataclasses.replace(states, **wide)
    else:
        rows = slice(None, None, 40)
        arrays = {name: value[rows] for name, value in vars(states).items() if isinstance(value, np.ndarray)}
        changed = dataclasses.replace(states, **arrays)
    data = mcap_bytes(dataclasses.replace(clean.log, low_state=changed, joint_ctrl=None), CHECKED[index % 2])
    return Damaged("implausible", ".mcap", data, True)


def bag_bytes(log: RobotLog) -> bytes:
    """The log as a sqlite3 bag of the Humble release."""
    bag = sqlite3.connect(":memory:")
    columns = "id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT"
    bag.execute(f"CREATE TABLE topics({columns})")
    bag.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    rows = []
    for number, (topic, (time_ns, values)) in enumerate(payloads(log).items(), start=1):
        bag.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')", (number, topic, schema_name(TOPICS[topic])))
        rows += [(number, stamp, row.tobytes()) for stamp, row in zip(time_ns.tolist(), values, strict=True)]
    rows.sort(key=lambda row: row[1])
    bag.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
    bag.commit()
    return bag.serialize()


def _stamped(log: RobotLog, clock: Callable[[np.ndarray], np.ndarray], storage: Storage) -> bytes:
    """The log's messages in the order of their receipt, with the stamps that a clock gives."""
    writer = McapWriter(storage)
    writer.metadata(METADATA, to_metadata(log.facts, START_NS))
    rows = []
    for topic, (time_ns, values) in payloads(log).items():
        channel = writer.channel(topic, schema_name(TOPICS[topic]), schema_text(TOPICS[topic]))
        stamps = clock(time_ns)
        rows += [
            (true, channel, stamp, row.tobytes())
            for true, stamp, row in zip(time_ns.tolist(), stamps.tolist(), values, strict=True)
        ]
    for _, channel, stamp, payload in sorted(rows, key=lambda row: row[0]):
        writer.message(channel, stamp, payload)
    return writer.finish()


def _flip(data: bytes, rng: np.random.Generator, count: int) -> bytes:
    flipped = bytearray(data)
    for place in rng.integers(0, len(data), size=count).tolist():
        flipped[place] ^= 1 << int(rng.integers(0, 8))
    return bytes(flipped)


def write_all(folder: Path, logs: list[Damaged]) -> list[Path]:
    """One file each."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{number:03d}_{log.kind}{log.suffix}" for number, log in enumerate(logs)]
    for path, log in zip(paths, logs, strict=True):
        path.write_bytes(log.data)
    return paths
