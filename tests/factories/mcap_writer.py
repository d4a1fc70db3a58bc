"""MCAP files message by message, and the other presets of rosbag2."""

import io
from collections import Counter
from collections.abc import Mapping

from pipeline.hardware_logs.write import QOS, ZSTD_SMALL, Storage, open_writer

ZSTD_FAST = Storage(chunk_crc=False)
FASTWRITE = Storage(compression="", chunk_bytes=0, chunk_crc=False)


class McapWriter:
    """A file that is written in memory: channels, messages in the order of receipt, metadata."""

    def __init__(self, storage: Storage = ZSTD_SMALL):
        self._stream, self._counts = io.BytesIO(), Counter()
        self._writer = open_writer(self._stream, storage)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        self._writer.add_metadata(name, dict(values))

    def channel(self, topic: str, schema: str, definition: str, encoding: str = "ros2msg") -> int:
        """Open a channel with a schema of its own; its number."""
        number = self._writer.register_schema(schema, encoding, definition.encode())
        return self._writer.register_channel(topic, "cdr", number, QOS)

    def message(self, channel: int, time_ns: int, payload: bytes) -> None:
        """Append a message, received and sent at `time_ns`."""
        self._writer.add_message(channel, time_ns, payload, time_ns, self._counts[channel])
        self._counts[channel] += 1

    def finish(self) -> bytes:
        """All bytes of the file, with summary and footer."""
        self._writer.finish()
        return self._stream.getvalue()
