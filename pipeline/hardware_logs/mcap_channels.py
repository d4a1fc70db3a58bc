"""The channels of an MCAP file, and the summary at its end as far as its checksum holds."""

import struct
import zlib
from dataclasses import dataclass, field
from typing import BinaryIO

from pipeline.hardware_logs.log_report import Bounds
from pipeline.hardware_logs.mcap_chunk import (
    CHANNEL,
    CHUNK_INDEX,
    FOOTER,
    FOOTER_LENGTH,
    MAGIC,
    RECORD_HEAD,
    SCHEMA,
    STATISTICS,
    STATISTICS_HEAD,
    Cursor,
)


@dataclass(frozen=True, kw_only=True)
class Schema:
    name: str
    encoding: str
    """`ros2msg`, `ros2idl`, …"""
    text: str


@dataclass(frozen=True, kw_only=True)
class Channel:
    topic: str
    encoding: str
    """Of the messages: `cdr`, …"""
    schema: Schema | None


@dataclass
class Channels:
    """Channels by number. The first definition of a number stays."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)

    def define(self, opcode: int, content: bytes) -> None:
        """Take a schema or channel record. Raises ValueError (also of text that is not UTF-8)."""
        cursor = Cursor(content)
        if opcode == SCHEMA:
            (number,) = cursor.numbers("H")
            name, encoding = cursor.text(), cursor.text()
            data = cursor.blob()
            if len(data) > Bounds.schema_bytes:
                raise ValueError(f"a schema of {len(data)} bytes")
            self.schemas.setdefault(number, Schema(name=name, encoding=encoding, text=bytes(data).decode()))
        else:
            number, schema = cursor.numbers("HH")
            topic, encoding = cursor.text(), cursor.text()
            cursor.text_map()
            found = Channel(topic=topic, encoding=encoding, schema=self.schemas.get(schema))
            self.channels.setdefault(number, found)
        if max(len(self.schemas), len(self.channels)) > Bounds.channels:
            raise ValueError(f"more than {Bounds.channels} channels")


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Contents of a summary. They are compared with what was read, never taken alone."""

    counts: dict[int, int] | None = None
    """Messages by channel, where it has statistics."""
    first_ns: int | None = None
    """Log time of the first message, where the checksum of the summary holds."""
    chunk_offsets: tuple[int, ...] = ()
    definitions: tuple[tuple[int, bytes], ...] = ()
    """Schemas and channels, where the checksum of the summary holds."""


def read_summary(stream: BinaryIO, size: int) -> Summary | None:
    """The summary of a file, an empty one where it says that it has none; None where it is missing or damaged."""
    end = size - len(MAGIC)
    if end < FOOTER_LENGTH:
        return None
    stream.seek(end - FOOTER_LENGTH)
    footer = stream.read(FOOTER_LENGTH + len(MAGIC))
    opcode, length = RECORD_HEAD.unpack_from(footer)
    start, _, crc = struct.unpack_from("<QQI", footer, RECORD_HEAD.size)
    body = end - FOOTER_LENGTH - start if start else 0
    if footer[-8:] != MAGIC or (opcode, length) != (FOOTER, 20) or not 0 <= body <= Bounds.record_bytes:
        return None
    stream.seek(start)
    data = stream.read(body)
    if crc and zlib.crc32(data + footer[: FOOTER_LENGTH - 4]) != crc:
        return None
    try:
        return _parse(data, checked=bool(crc))
    except (ValueError, struct.error):
        return None


def _parse(data: bytes, *, checked: bool) -> Summary:
    counts, first, chunks, definitions, at = None, None, [], [], 0
    while at < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        content = data[at + RECORD_HEAD.size : at + RECORD_HEAD.size + length]
        at += RECORD_HEAD.size + length
        if opcode in (SCHEMA, CHANNEL):
            definitions.append((opcode, content))
        elif opcode == CHUNK_INDEX:
            chunks.append(Cursor(content).numbers("QQQ")[2])
        elif opcode == STATISTICS:
            cursor = Cursor(content)
            first = cursor.numbers(STATISTICS_HEAD.format[1:])[6]
            counts = dict(struct.iter_unpack("<HQ", bytes(cursor.blob())))
    return Summary(
        counts=counts,
        first_ns=first if checked and counts else None,
        chunk_offsets=tuple(sorted(chunks)),
        definitions=tuple(definitions) if checked else (),
    )
