"""Writes MCAP files as `ros2 bag record -s mcap` does; the same messages give the same bytes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import lz4.frame
import zstandard

from pipeline.hardware_logs.mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_HEAD,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    FOOTER_LENGTH,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    RECORD_HEAD,
    SCHEMA,
    STATISTICS,
    STATISTICS_HEAD,
    SUMMARY_OFFSET,
    blob,
    record,
    text,
    text_map,
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


def compress(data: bytes, compression: str) -> bytes:
    """A chunk's records as they are stored."""
    if compression == "zstd":
        return zstandard.ZstdCompressor(level=3).compress(data)
    return lz4.frame.compress(data) if compression == "lz4" else data


class McapWriter:
    """An MCAP file that is being written in memory: channels, messages in the order of receipt, metadata."""

    def __init__(self, storage: Storage = ZSTD_SMALL, profile: str = "ros2"):
        self.storage = storage
        self._parts, self._end = [MAGIC], len(MAGIC)
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._counts: list[int] = []
        self._metadata: list[bytes] = []
        self._chunks: list[bytes] = []
        self._first, self._last = 0, 0
        self._total = 0
        self._open_chunk()
        self._put(record(HEADER, text(profile) + text(LIBRARY)))

    def _open_chunk(self) -> None:
        self._chunk, self._size, self._span = [], 0, None
        self._index: dict[int, list[bytes]] = {}

    def _put(self, data: bytes) -> int:
        """Append to the file; the offset it is at."""
        self._parts.append(data)
        self._end += len(data)
        return self._end - len(data)

    def _into_chunk(self, data: bytes) -> int:
        """Append to the open chunk, or to the file where there are no chunks; the offset there."""
        if not self.storage.chunk_bytes:
            return self._put(data)
        self._chunk.append(data)
        self._size += len(data)
        return self._size - len(data)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """A metadata record. Closes the chunk that is open."""
        self._close_chunk()
        data = record(METADATA, text(name) + text_map(values))
        self._metadata.append(record(METADATA_INDEX, struct.pack("<QQ", self._put(data), len(data)) + text(name)))

    def channel(self, topic: str, schema: str, definition: str, encoding: str = "ros2msg") -> int:
        """Open a channel with a schema of its own; its number."""
        number = len(self._channels)
        self._schemas.append(
            record(SCHEMA, struct.pack("<H", number + 1) + text(schema) + text(encoding) + blob(definition.encode()))
        )
        content = struct.pack("<HH", number, number + 1) + text(topic) + text("cdr")
        self._channels.append(record(CHANNEL, content + text_map({"offered_qos_profiles": ""})))
        self._counts.append(0)
        self._into_chunk(self._schemas[-1] + self._channels[-1])
        return number

    def message(self, channel: int, time_ns: int, payload: bytes | memoryview) -> None:
        """Append a message."""
        sequence = self._counts[channel]
        head = MESSAGE_HEAD.pack(MESSAGE, 22 + len(payload), channel, sequence, time_ns, time_ns)
        at = self._into_chunk(head + payload)
        self._counts[channel] += 1
        self._total += 1
        self._first = min(self._first, time_ns) if self._total > 1 else time_ns
        self._last = max(self._last, time_ns)
        if not self.storage.chunk_bytes:
            return
        self._index.setdefault(channel, []).append(struct.pack("<QQ", time_ns, at))
        first, last = self._span or (time_ns, time_ns)
        self._span = (min(first, time_ns), max(last, time_ns))
        if self._size >= self.storage.chunk_bytes:
            self._close_chunk()

    def _close_chunk(self) -> None:
        if not self._size:
            return
        records = b"".join(self._chunk)
        span = self._span or (0, 0)
        crc = zlib.crc32(records) if self.storage.chunk_crc else 0
        stored, kind = compress(records, self.storage.compression), text(self.storage.compression)
        content = CHUNK_HEAD.pack(*span, len(records), crc) + kind + struct.pack("<Q", len(stored)) + stored
        start = self._put(record(CHUNK, content))
        length, places = self._end - start, []
        for channel, entries in self._index.items():
            index = record(MESSAGE_INDEX, struct.pack("<H", channel) + blob(b"".join(entries)))
            places.append(struct.pack("<HQ", channel, self._put(index)))
        head = struct.pack("<QQQQ", *span, start, length) + blob(b"".join(places))
        sizes = struct.pack("<QQ", len(stored), len(records))
        behind = struct.pack("<Q", self._end - start - length)
        self._chunks.append(record(CHUNK_INDEX, head + behind + kind + sizes))
        self._open_chunk()

    def finish(self) -> bytes:
        """Close the file with summary and footer; all its bytes."""
        self._close_chunk()
        self._put(record(DATA_END, struct.pack("<I", 0)))
        counts = b"".join(struct.pack("<HQ", *each) for each in enumerate(self._counts) if each[1])
        numbers = (self._total, len(self._schemas), len(self._channels), 0, len(self._metadata))
        head = STATISTICS_HEAD.pack(*numbers, len(self._chunks), self._first, self._last)
        groups = {
            SCHEMA: self._schemas,
            CHANNEL: self._channels,
            STATISTICS: [record(STATISTICS, head + blob(counts))],
            METADATA_INDEX: self._metadata,
            CHUNK_INDEX: self._chunks,
        }
        start, summary, offsets = self._end, b"", b""
        for opcode, records in groups.items():
            if records:
                place = struct.pack("<BQQ", opcode, start + len(summary), sum(map(len, records)))
                summary, offsets = summary + b"".join(records), offsets + record(SUMMARY_OFFSET, place)
        footer = RECORD_HEAD.pack(FOOTER, FOOTER_LENGTH - RECORD_HEAD.size)
        footer += struct.pack("<QQ", start, start + len(summary))
        crc = zlib.crc32(summary + offsets + footer)
        self._put(summary + offsets + footer + struct.pack("<I", crc) + MAGIC)
        return b"".join(self._parts)
