"""Decode payloads to numpy rows, one type per topic: vectorized for known schemas, else message by message.

Unreadable messages are left out and counted; a log is rejected if the schema of a topic lacks required fields.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from pipeline.hardware_logs.mcap_records import Channel
from pipeline.hardware_logs.messages import ENCAPSULATION, MESSAGES, TOPICS, Field, is_known_text, payload_dtype

SEQUENCES = {message: [field.name for field in fields if field.length is None] for message, fields in MESSAGES.items()}


class SchemaError(ValueError):
    """Raised for a schema without the fields that its topic needs."""


@dataclass
class JointCount:
    """Number of joints of a log's robot, from the first valid message, for all topics."""

    allowed: tuple[int, ...]
    count: int | None = None
    other: int | None = None
    """A count that no robot has, if one occurred."""

    def accept(self, count: int) -> bool:
        if count not in self.allowed:
            self.other = count
            return False
        self.count = self.count or count
        return count == self.count


Decoded = tuple[np.ndarray, Bool[np.ndarray, " m"]]
"""Rows of `messages.payload_dtype`, and the mask of the m messages that were decoded."""


class TopicDecoder:
    """Decodes the messages of one channel."""

    def __init__(self, channel: Channel, joints: JointCount):
        self.topic, self.message, self.joints = channel.topic, TOPICS[channel.topic], joints
        schema = channel.schema
        if channel.encoding != "cdr" or schema is None:
            raise SchemaError(f"{channel.topic} is encoded as '{channel.encoding[:20]}', only cdr is read")
        self._known = schema.encoding == "ros2msg" and is_known_text(self.message, schema.text)
        self._name, self._encoding, self._text = schema.name, schema.encoding, schema.text
        self._store: Any = None

    def decode(self, data: bytes, start: Int[np.ndarray, " m"], stop: Int[np.ndarray, " m"]) -> Decoded:
        """Rows of the messages between `start` and `stop` in `data`. Raises SchemaError."""
        view, spans = memoryview(data), list(zip(start.tolist(), stop.tolist(), strict=True))
        kept = np.zeros(len(spans), dtype=bool)
        dtype = self._dtype(view, spans) if self._known else None
        if dtype is not None:
            fits = (stop - start) == dtype.itemsize
            payloads = [view[one:other] for (one, other), fit in zip(spans, fits.tolist(), strict=True) if fit]
            rows = np.frombuffer(b"".join(payloads), dtype=dtype)
            sound = self._sound(rows)
            kept[np.flatnonzero(fits)[sound]] = True
            rows = rows if sound.all() else rows[sound]
            if kept.all():
                return rows, kept
        return self._slowly(view, spans, kept, rows if dtype is not None else None)

    def _dtype(self, view: memoryview, spans: list[tuple[int, int]]) -> np.dtype | None:
        """Numpy type of the payloads; None while the number of joints is unknown."""
        names = SEQUENCES[self.message]
        if names and self.joints.count is None:
            for one, other in spans:
                count = _stated_count(view[one:other], self.message)
                if count is not None and self.joints.accept(count):
                    break
            else:
                return None
        return payload_dtype(self.message, *([self.joints.count] * len(names)))

    def _sound(self, rows: np.ndarray) -> np.ndarray:
        """Mask of rows whose header and counts agree with their size."""
        sound = rows["encapsulation"] == np.void(ENCAPSULATION)
        for name in SEQUENCES[self.message]:
            sound &= rows[f"{name}_count"] == self.joints.count
        return sound

    def _slowly(
        self, view: memoryview, spans: list[tuple[int, int]], kept: np.ndarray, fast: np.ndarray | None
    ) -> Decoded:
        """Decode the remaining messages with rosbags; rows stay in file order."""
        rows, place = [], 0
        for index, (one, other) in enumerate(spans):
            if kept[index] and fast is not None:
                rows.append(fast[place])
                place += 1
                continue
            row = self._row(view[one:other]) if self._may_be_read(view[one:other]) else None
            if row is not None:
                rows.append(row)
                kept[index] = True
        count = self.joints.count or self.joints.allowed[0]
        dtype = payload_dtype(self.message, *[count] * len(SEQUENCES[self.message]))
        return np.array(rows, dtype=dtype), kept

    def _may_be_read(self, payload: memoryview) -> bool:
        """Whether rosbags may decode it: with a known schema only another byte order or padding to a word."""
        if not self._known or payload[:4] != ENCAPSULATION:
            return True
        count = _stated_count(payload[: len(payload) // 4 * 4], self.message) if SEQUENCES[self.message] else None
        return count is not None or not SEQUENCES[self.message]

    def _row(self, payload: memoryview) -> Any:
        if self._store is None:
            self._store = self._register()
        try:
            message = self._store.deserialize_cdr(bytes(payload), self._name)
        except MemoryError:
            raise
        except Exception:  # rosbags' generated code raises various errors: struct.error, AssertionError, ValueError, …
            return None
        counts = [len(_value(message, name, self.topic, self._name)) for name in SEQUENCES[self.message]]
        if counts and not all(self.joints.accept(count) for count in counts):
            return None
        row = np.zeros((), dtype=payload_dtype(self.message, *counts))
        row["encapsulation"] = np.void(ENCAPSULATION)
        for name, count in zip(SEQUENCES[self.message], counts, strict=True):
            row[f"{name}_count"] = count
        try:
            self._fill(row, message, MESSAGES[self.message])
        except (TypeError, ValueError, OverflowError) as error:
            raise SchemaError(f"{self.topic} is a {self._name[:60]} whose fields have other types") from error
        return row[()]

    def _fill(self, row: Any, message: Any, fields: tuple[Field, ...]) -> None:
        for field in fields:
            value = _value(message, field.name, self.topic, self._name)
            if field.kind == "int8":  # the vendor's IDL has the same byte as uint8
                row[field.name] = (value + 128) % 256 - 128
            elif field.kind not in MESSAGES:
                row[field.name] = value
            elif field.length == 1:
                self._fill(row[field.name], value, MESSAGES[field.kind])
            else:
                for index, entry in enumerate(value):
                    self._fill(row[field.name][index], entry, MESSAGES[field.kind])

    def _register(self) -> Any:
        """Register the file's schema with rosbags. Raises SchemaError."""
        from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

        store = get_typestore(Stores.ROS2_HUMBLE)
        try:
            if self._encoding == "ros2msg":
                types = get_types_from_msg(self._text, self._name)
            elif self._encoding == "ros2idl":
                types = get_types_from_idl(self._text)
            else:
                raise ValueError(f"encoding '{self._encoding[:20]}', known are ros2msg and ros2idl")
            store.register({name: fields for name, fields in types.items() if name not in store.types})
        except MemoryError:
            raise
        except Exception as error:  # its parser raises various errors on invalid text
            raise SchemaError(f"the schema of {self.topic} can't be read ({str(error)[:80]})") from error
        return store


def _value(message: Any, name: str, topic: str, kind: str) -> Any:
    try:
        return getattr(message, name)
    except AttributeError:
        raise SchemaError(f"{topic} is a {kind[:60]} without '{name}'") from None


def _stated_count(payload: memoryview, message: str) -> int | None:
    """Joint count of a payload whose size agrees with it."""
    names = SEQUENCES[message]
    fields: Any = payload_dtype(message, *[0] * len(names)).fields
    at = fields[f"{names[0]}_count"][1]
    if len(payload) < at + 4 or payload[:4] != ENCAPSULATION:
        return None
    count = int.from_bytes(payload[at : at + 4], "little")
    fits = count < 1_000 and payload_dtype(message, *[count] * len(names)).itemsize == len(payload)
    return count if fits else None
