"""What a trial holds is what rosbags, an independent reader, finds in the log: of every field, by every way in."""

import dataclasses

import numpy as np
import pytest
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from pipeline.files import settings
from pipeline.hardware_logs import LogSettings, Trial, ingest, layouts, mcap_bytes, read_trial, write_mcap
from pipeline.hardware_logs.messages import MESSAGES, PRIMITIVES, TOPICS, schema_name, schema_text
from pipeline.hardware_logs.write import payloads
from tests.factories.damaged_logs import bag_bytes
from tests.factories.mcap_writer import McapWriter
from tests.factories.robot_logs import START_NS, robot_log


def typestore(texts: dict[str, str] | None = None):
    store, types = get_typestore(Stores.ROS2_HUMBLE), {}
    for message in TOPICS.values():
        types |= get_types_from_msg((texts or {}).get(message) or schema_text(message), schema_name(message))
    store.register(types)
    return store


def read_by_rosbags(path, store) -> dict[str, tuple[np.ndarray, list]]:
    """Stamps and messages of each topic."""
    found: dict[str, tuple[list, list]] = {}
    with Reader(path) as reader:
        for connection, time_ns, raw in reader.messages():
            times, messages = found.setdefault(connection.topic, ([], []))
            times.append(time_ns)
            messages.append(store.deserialize_cdr(raw, connection.msgtype))
    return {topic: (np.array(times), messages) for topic, (times, messages) in found.items()}


def column(messages, *names) -> np.ndarray:
    """A field of all messages; a step into a sequence takes all of its entries."""
    values = messages
    for name in names:
        values = [
            [getattr(entry, name) for entry in each] if isinstance(each, list) else getattr(each, name)
            for each in values
        ]
    return np.array(values)


def assert_holds(trial: Trial, found: dict[str, tuple[np.ndarray, list]]) -> None:
    """Every column of the trial against rosbags' messages, resampled by numpy one column at a time."""
    times, states = found["/low_state"]
    grid = trial.start_ns + np.round(trial.time_s * 1e9).astype(np.int64)
    seconds, at = (times - trial.start_ns) * 1e-9, (grid - trial.start_ns) * 1e-9

    def linear(values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(at, seconds, each) for each in values.T.astype(np.float64)], axis=1)

    def held(stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
        return values[np.searchsorted(stamps, grid, side="right") - 1]

    serial = {"joint_pos": "q", "joint_vel": "dq", "torque_est": "tau_est"}
    for name, source in serial.items():
        np.testing.assert_allclose(
            getattr(trial, name), linear(column(states, "motor_state_serial", source)), atol=1e-5
        )
    for name, source in {"rpy": "rpy", "gyro_b": "gyro", "acc_b": "acc"}.items():
        np.testing.assert_allclose(getattr(trial, name), linear(column(states, "imu_state", source)), atol=1e-5)
    for name, source in {"temperature_c": "temperature", "lost": "lost"}.items():
        np.testing.assert_array_equal(getattr(trial, name), held(times, column(states, "motor_state_serial", source)))
    stamps, commands = found["/joint_ctrl"]
    for name, source in {"target_pos": "q", "target_torque": "tau", "kp": "kp", "kd": "kd"}.items():
        np.testing.assert_array_equal(
            getattr(trial, name), held(stamps, column(commands, "motor_cmd", source)).astype(np.float32)
        )
    stamps, falls = found["/fall_down"]
    np.testing.assert_array_equal(trial.fall_state, held(stamps, column(falls, "fall_down_state")))
    stamps, odometry = found["/odometer_state"]
    pose = np.stack([column(odometry, name) for name in ("x", "y", "theta")], axis=1)
    np.testing.assert_array_equal(trial.odometer, held(stamps, pose).astype(np.float32))


@pytest.fixture
def read(root, robot, tmp_path):
    """Ingest a file; its only trial."""

    def read(path) -> Trial:
        values = settings.read(root / "data/hardware_logs.yaml", LogSettings)
        made = ingest(path, "log", tmp_path / "out", layouts=layouts([robot]), settings=values)
        (trial,) = made.trials
        return read_trial(trial.path)

    return read


def jittery_log(robot):
    """A log whose messages come when they come, so that every sample lies between two."""
    log, rng = robot_log(robot, 1.0), np.random.default_rng(3)
    state = log.low_state
    times = state.time_ns + rng.integers(0, 1_500_000, size=len(state.time_ns))
    return dataclasses.replace(log, low_state=dataclasses.replace(state, time_ns=np.sort(times)))


@pytest.mark.parametrize("make", [robot_log, jittery_log])
def test_mcap_in_the_known_schema(robot, read, tmp_path, make):
    write_mcap(tmp_path / "log.mcap", make(robot))
    assert_holds(read(tmp_path / "log.mcap"), read_by_rosbags(tmp_path / "log.mcap", typestore()))


def test_sqlite3_bags(robot, read, tmp_path):
    log = robot_log(robot, 1.0)
    (tmp_path / "log.db3").write_bytes(bag_bytes(log))
    write_mcap(tmp_path / "log.mcap", log)
    trial = read(tmp_path / "log.db3")
    assert trial.integrity == "unverified"
    assert_holds(trial, read_by_rosbags(tmp_path / "log.mcap", typestore()))


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_bags_that_rosbags_wrote(robot, read, tmp_path, plugin):
    store = typestore()
    with Writer(tmp_path / "bag", version=9, storage_plugin=plugin) as writer:
        rows = []
        for topic, (times, values) in payloads(robot_log(robot, 0.5)).items():
            connection = writer.add_connection(topic, schema_name(TOPICS[topic]), typestore=store)
            rows += [(stamp, connection, row.tobytes()) for stamp, row in zip(times.tolist(), values, strict=True)]
        for stamp, connection, payload in sorted(rows, key=lambda row: row[0]):
            writer.write(connection, stamp, payload)
    (path,) = [each for each in (tmp_path / "bag").iterdir() if each.suffix in (".mcap", ".db3")]
    trial = read(path)
    assert_holds(trial, read_by_rosbags(tmp_path / "bag", store))
    assert trial.policy_digest is None


def reordered(message: str) -> str:
    """A schema whose fields stand in another order, with one more."""
    text = schema_text(message)
    if message == "LowState":
        head, *rest = text.split("=" * 80)
        head = "\n".join(["float64 supply_voltage", *reversed(head.strip().splitlines())]) + "\n"
        text = ("=" * 80).join([head, *rest])
    return text


def idl(message: str) -> str:
    """The known schema as IDL, as newer recorders embed it."""
    names = {
        "int8": "int8",
        "uint8": "uint8",
        "bool": "boolean",
        "float32": "float",
        "int32": "int32",
        "uint32": "uint32",
    }

    def struct(kind: str) -> list[str]:
        lines, defs = [], []
        for field in MESSAGES[kind]:
            inner = names.get(field.kind, f"booster_interface::msg::{field.kind}")
            if field.length is None:
                inner = f"sequence<{inner}>"
            elif field.length > 1:
                defs.append(f"typedef {names[field.kind]} {kind}_{field.name}[{field.length}];")
                inner = f"{kind}_{field.name}"
            lines.append(f"{inner} {field.name};")
        return [*defs, f"struct {kind} {{", *lines, "};"]

    held = [each.kind for each in MESSAGES[message] if each.kind not in PRIMITIVES]
    body = [line for kind in (*dict.fromkeys(held), message) for line in struct(kind)]
    return "\n".join(["module booster_interface {", "module msg {", *body, "};", "};"])


def rewritten(robot, texts: dict[str, str], encoding: str) -> bytes:
    """The log with messages that rosbags serialized by other schemas."""
    log, store = robot_log(robot, 0.3), get_typestore(Stores.ROS2_HUMBLE)
    types = {}
    for message in TOPICS.values():
        name = schema_name(message)
        found = (
            get_types_from_msg(texts[message], name) if encoding == "ros2msg" else get_types_from_idl(texts[message])
        )
        types |= {key: value for key, value in found.items() if key not in types}
    store.register(types)
    known, rows, writer = typestore(), [], McapWriter()
    for topic, (times, values) in payloads(log).items():
        name = schema_name(TOPICS[topic])
        channel = writer.channel(topic, name, texts[TOPICS[topic]], encoding)
        for stamp, row in zip(times.tolist(), values, strict=True):
            message = converted(known.deserialize_cdr(row.tobytes(), name), store)
            rows.append((stamp, channel, bytes(store.serialize_cdr(message, name))))
    for stamp, channel, payload in sorted(rows, key=lambda row: row[0]):
        writer.message(channel, stamp, payload)
    return writer.finish()


def converted(message, store):
    """The message as the type of that name in another store."""
    kind = store.types[message.__msgtype__]
    values = {}
    for field in dataclasses.fields(kind):
        if field.name == "__msgtype__":
            continue
        value = getattr(message, field.name, 24.0)
        if isinstance(value, list):
            value = [converted(entry, store) for entry in value]
        values[field.name] = converted(value, store) if hasattr(value, "__msgtype__") else value
    return kind(**values)


@pytest.mark.parametrize("encoding", ["ros2msg", "ros2idl"])
def test_other_schemas_are_read_field_by_field(robot, read, tmp_path, encoding):
    make = reordered if encoding == "ros2msg" else idl
    texts = {message: make(message) for message in TOPICS.values()}
    (tmp_path / "other.mcap").write_bytes(rewritten(robot, texts, encoding))
    (tmp_path / "known.mcap").write_bytes(mcap_bytes(robot_log(robot, 0.3)))
    trial = read(tmp_path / "other.mcap")
    assert trial.start_ns == START_NS
    assert trial.integrity == "complete"
    assert_holds(trial, read_by_rosbags(tmp_path / "known.mcap", typestore()))
