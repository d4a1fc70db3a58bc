"""Writes MCAP files as `ros2 bag record -s mcap` does, with the official writer; same messages, same bytes."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from mcap.writer import CompressionType, Writer

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

    def __init__(self, storage: Storage = ZSTD_SMALL, profile: str = "ros2"):
        self._stream, self._counts = io.BytesIO(), Counter()
        self._writer = Writer(
            self._stream,
            chunk_size=storage.chunk_bytes,
            compression=CompressionType[storage.compression.upper() or "NONE"],
            use_chunking=storage.chunk_bytes > 0,
            enable_crcs=storage.chunk_crc,
        )
        self._writer.start(profile, LIBRARY)

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
