"""Every field of every message, ours against rosbags: random bytes in each, also in those that no trial keeps."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.hardware_logs.decode import SEQUENCES, JointCount, TopicDecoder
from pipeline.hardware_logs.mcap_records import Channel, Schema
from pipeline.hardware_logs.messages import (
    ENCAPSULATION,
    MESSAGES,
    TOPICS,
    payload_dtype,
    schema_name,
    schema_text,
)

JOINTS = 23


@pytest.mark.parametrize("topic", TOPICS)
def test_all_fields_of_random_messages_are_what_rosbags_reads(topic):
    message = TOPICS[topic]
    rows = _random_rows(message, 20)
    payloads = [row.tobytes() for row in rows]
    schema = Schema(name=schema_name(message), encoding="ros2msg", text=schema_text(message))
    decoder = TopicDecoder(Channel(topic=topic, encoding="cdr", schema=schema), JointCount(allowed=(JOINTS,)))
    stops = np.cumsum([len(payload) for payload in payloads])
    starts = np.concatenate([[0], stops[:-1]])
    decoded, kept = decoder.decode(b"".join(payloads), starts, stops)
    assert kept.all()
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(schema_text(message), schema_name(message)))
    compared = 0
    for payload, row in zip(payloads, decoded, strict=True):
        compared += _compare(row, store.deserialize_cdr(payload, schema_name(message)), message)
    assert compared >= 20 * len(MESSAGES[message])


def _random_rows(message: str, count: int) -> np.ndarray:
    """Messages whose every octet is drawn; floats that are NaN are compared as such, bools are 0 or 1."""
    rng = np.random.default_rng(11)
    dtype = payload_dtype(message, *[JOINTS] * len(SEQUENCES[message]))
    rows = np.frombuffer(rng.bytes(dtype.itemsize * count), dtype=dtype).copy()
    rows["encapsulation"] = np.void(ENCAPSULATION)
    for name in SEQUENCES[message]:
        rows[f"{name}_count"] = JOINTS
    for field in MESSAGES[message]:
        if field.kind == "bool":
            rows[field.name] %= 2
    return rows


def _compare(row, message, name: str) -> int:
    """How many primitive fields were found equal."""
    compared = 0
    for field in MESSAGES[name]:
        ours, theirs = row[field.name], getattr(message, field.name)
        if field.kind not in MESSAGES:
            np.testing.assert_array_equal(np.asarray(ours), np.asarray(theirs), err_msg=f"{name}.{field.name}")
            compared += 1
        elif field.length == 1:
            compared += _compare(ours, theirs, field.kind)
        else:
            assert len(ours) == len(theirs) == JOINTS
            compared += sum(_compare(one, other, field.kind) for one, other in zip(ours, theirs, strict=True))
    return compared
