"""Bytes of MCAP's records: opcodes, heads of records, and a cursor over their fields (mcap.dev/spec)."""

from __future__ import annotations

import struct

MAGIC = b"\x89MCAP0\r\n"

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(0x01, 0x09)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(0x09, 0x10)

RECORD_HEAD = struct.Struct("<BQ")
"""Opcode and length of what follows."""
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""Opcode, length, channel, sequence, log time, publish time; the payload follows."""
CHUNK_HEAD = struct.Struct("<QQQI")
"""First and last time, size and CRC-32 of the records before compression."""
STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")
"""Messages, schemas, channels, attachments, metadata, chunks, first and last time."""
FOOTER_LENGTH = RECORD_HEAD.size + 20
"""Bytes of the footer record; the magic follows."""


class Cursor:
    """Reads fields of a record's content one after the other. Raises ValueError where it ends too early."""

    def __init__(self, content: bytes | memoryview):
        self.content, self.at = memoryview(content), 0

    def take(self, size: int) -> memoryview:
        if size > len(self.content) - self.at:
            raise ValueError(f"a record of {len(self.content)} bytes ends within a field")
        self.at += size
        return self.content[self.at - size : self.at]

    def numbers(self, layout: str) -> tuple:
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def blob(self) -> memoryview:
        return self.take(self.numbers("I")[0])

    def text(self) -> str:
        return bytes(self.blob()).decode()

    def text_map(self) -> dict[str, str]:
        inner, found = Cursor(self.blob()), {}
        while inner.at < len(inner.content):
            key = inner.text()
            found[key] = inner.text()
        return found
