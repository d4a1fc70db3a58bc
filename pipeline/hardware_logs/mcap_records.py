"""Parse MCAP records from bytes (mcap.dev/spec): headers, fields, chunks, the summary."""

import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from jaxtyping import Int
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from pipeline.hardware_logs.log_report import Bounds

MAGIC = b"\x89MCAP0\r\n"

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and content length of a record."""
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time; the payload follows."""
CHUNK_HEAD = struct.Struct("<QQQI")
"""First and last time, size and CRC-32 of the records before compression."""
FOOTER_LENGTH = RECORD_HEAD.size + 20
"""Bytes of the footer record; the magic follows."""


class Fields(ReadDataStream):
    """Sequential reader of a record's fields. Raises ValueError at the end of the content."""

    def __init__(self, content: bytes):
        super().__init__(BytesIO(content))
        self._size = len(content)

    def read(self, length: int) -> bytes:
        if length > self._size - self.count:
            raise ValueError(f"a record of {self._size} bytes ends within a field")
        return super().read(length)


HEADS = np.dtype("u1, <u8, <u2, <u4, <u8, <u8")
HEADS.names = ("opcode", "length", "channel", "sequence", "time_ns", "publish_ns")
"""Header of a message as a numpy type."""
MESSAGE, DEFINITIONS = int(Opcode.MESSAGE), (int(Opcode.SCHEMA), int(Opcode.CHANNEL))
WINDOW_BYTES = 1 << 27
"""Largest window of a zstd frame [bytes]."""


@dataclass(frozen=True, kw_only=True)
class Records:
    """m message records in the order of the file, inside `data`."""

    data: bytes
    channel: Int[np.ndarray, " m"]
    time_ns: Int[np.ndarray, " m"]
    """Log time [ns]."""
    start: Int[np.ndarray, " m"]
    """Offset of the payload's first byte."""
    stop: Int[np.ndarray, " m"]
    end: int
    """Offset after the last parsed record."""
    definitions: tuple[tuple[int, bytes], ...]
    """Opcode and content of schemas and channels, in their order."""


def open_chunk(content: bytes, limit: int) -> tuple[bytes, bool]:
    """Decompressed records of a chunk, and whether it has a checksum. Raises ValueError."""
    fields = Fields(content)
    chunk = records.Chunk.read(fields)
    size, crc = chunk.uncompressed_size, chunk.uncompressed_crc
    if fields.count != len(content):
        raise ValueError(f"a chunk that states {len(chunk.data)} bytes is followed by {len(content) - fields.count}")
    if size > limit:
        raise ValueError(f"a chunk of {size} bytes, at most {limit} are allowed")
    data = _inflate(chunk.data, chunk.compression, size)
    if crc and zlib.crc32(data) != crc:
        raise ValueError("a chunk with a wrong checksum")
    if chunk.message_end_time < chunk.message_start_time:
        raise ValueError("a chunk that ends before it starts")
    return data, bool(crc)


def _inflate(stored: bytes, compression: str, size: int) -> bytes:
    try:
        if compression == "zstd":
            if zstandard.frame_content_size(stored) not in (-1, size):
                raise ValueError("a chunk of another size than it states")
            inflater = zstandard.ZstdDecompressor(max_window_size=WINDOW_BYTES)
            data = inflater.decompress(stored, max_output_size=size) if size else b""
        elif compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
        elif compression == "":
            data = stored
        else:
            raise ValueError(f"a chunk of the unknown compression {compression[:20]!r}")
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise ValueError(f"a chunk that can't be inflated ({str(error).splitlines()[0][:80]})") from error
    if len(data) != size:
        raise ValueError("a chunk of another size than it states")
    return data


def cut(data: bytes, *, whole: bool) -> Records:
    """Parse records up to the first that is not a message, schema or channel, or is incomplete.

    With `whole` such a record raises ValueError.
    """
    places, definitions = [], []
    unpack, size, at = RECORD_HEAD.unpack_from, len(data), 0
    while at + RECORD_HEAD.size <= size:
        opcode, length = unpack(data, at)
        end = at + 9 + length
        if end > size:
            break
        if opcode == MESSAGE and length >= 22:
            places.append(at)
        elif opcode in DEFINITIONS:
            definitions.append((opcode, data[at + RECORD_HEAD.size : end]))
        else:
            break
        at = end
    if whole and at != size:
        raise ValueError("a chunk whose records do not add up")
    head_at = np.array(places, dtype=np.int64)
    heads = np.frombuffer(data, dtype=np.uint8)[head_at[:, None] + np.arange(MESSAGE_HEAD.size)].view(HEADS)[:, 0]
    return Records(
        data=data,
        channel=heads["channel"].astype(np.int64),
        time_ns=heads["time_ns"].astype(np.int64),
        start=head_at + MESSAGE_HEAD.size,
        stop=head_at + RECORD_HEAD.size + heads["length"].astype(np.int64),
        end=at,
        definitions=tuple(definitions),
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
    """Encoding of the messages: `cdr`, …"""
    schema: Schema | None


@dataclass
class Channels:
    """Channels by id. The first definition of an id is kept."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)

    def define(self, opcode: int, content: bytes) -> None:
        """Add a schema or channel record. Raises ValueError (also for text that is not UTF-8)."""
        if opcode == Opcode.SCHEMA:
            one = records.Schema.read(Fields(content))
            if len(one.data) > Bounds.schema_bytes:
                raise ValueError(f"a schema of {len(one.data)} bytes")
            self.schemas.setdefault(one.id, Schema(name=one.name, encoding=one.encoding, text=one.data.decode()))
        else:
            one = records.Channel.read(Fields(content))
            found = Channel(topic=one.topic, encoding=one.message_encoding, schema=self.schemas.get(one.schema_id))
            self.channels.setdefault(one.id, found)
        if max(len(self.schemas), len(self.channels)) > Bounds.channels:
            raise ValueError(f"more than {Bounds.channels} channels")


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Contents of a summary, used only for comparison with the data section."""

    counts: dict[int, int] | None
    """Number of messages by channel, if the summary has statistics."""
    first_ns: int | None
    """Log time of the first message, if the summary's checksum is correct [ns]."""
    chunk_offsets: tuple[int, ...]
    definitions: tuple[tuple[int, bytes], ...]
    """Schemas and channels, if the summary's checksum is correct."""


def read_summary(stream: BinaryIO, size: int) -> Summary | None:
    """Read the summary of a file; empty if the footer states that there is none; None if it is missing or damaged."""
    end = size - len(MAGIC)
    if end < FOOTER_LENGTH:
        return None
    stream.seek(end - FOOTER_LENGTH)
    footer = stream.read(FOOTER_LENGTH + len(MAGIC))
    opcode, length = RECORD_HEAD.unpack_from(footer)
    stated = records.Footer.read(Fields(footer[RECORD_HEAD.size :]))
    start, crc = stated.summary_start, stated.summary_crc
    body = end - FOOTER_LENGTH - start if start else 0
    if footer[-8:] != MAGIC or (opcode, length) != (Opcode.FOOTER, 20) or not 0 <= body <= Bounds.record_bytes:
        return None
    stream.seek(start)
    data = stream.read(body)
    if crc and zlib.crc32(data + footer[: FOOTER_LENGTH - 4]) != crc:
        return None
    try:
        return _parse_summary(data, checked=bool(crc))
    except (ValueError, struct.error):
        return None


def _parse_summary(data: bytes, *, checked: bool) -> Summary:
    counts, first, chunks, definitions, at = None, None, [], [], 0
    while at < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        content = data[at + RECORD_HEAD.size : at + RECORD_HEAD.size + length]
        at += RECORD_HEAD.size + length
        if opcode in DEFINITIONS:
            definitions.append((opcode, content))
        elif opcode == Opcode.CHUNK_INDEX:
            chunks.append(records.ChunkIndex.read(Fields(content)).chunk_start_offset)
        elif opcode == Opcode.STATISTICS:
            statistics = records.Statistics.read(Fields(content))
            first, counts = statistics.message_start_time, statistics.channel_message_counts
    return Summary(
        counts=counts,
        first_ns=first if checked and counts else None,
        chunk_offsets=tuple(sorted(chunks)),
        definitions=tuple(definitions) if checked else (),
    )
