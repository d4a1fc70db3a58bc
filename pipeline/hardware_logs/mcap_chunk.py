"""Records of MCAP files as bytes (mcap.dev/spec): opcodes, heads, fields, and chunks that are checked and cut."""

import struct
import zlib
from dataclasses import dataclass

import lz4.frame
import numpy as np
import zstandard
from jaxtyping import Int

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


HEADS = np.dtype("u1, <u8, <u2, <u4, <u8, <u8")
HEADS.names = ("opcode", "length", "channel", "sequence", "time_ns", "publish_ns")
"""The head of a message as numpy has it."""
WINDOW_BYTES = 1 << 27
"""Largest window a zstd frame may ask memory for."""


@dataclass(frozen=True, kw_only=True)
class Records:
    """m message records in the order of the file, inside `data`."""

    data: bytes
    channel: Int[np.ndarray, " m"]
    time_ns: Int[np.ndarray, " m"]
    """Log time."""
    start: Int[np.ndarray, " m"]
    """First byte of the payload."""
    stop: Int[np.ndarray, " m"]
    end: int
    """First byte behind the last record that was cut."""
    definitions: tuple[tuple[int, bytes], ...]
    """Opcode and content of schemas and channels, in their order."""


def open_chunk(content: bytes, limit: int) -> tuple[bytes, bool]:
    """Records in a chunk record's content after inflation, and whether it has a checksum. Raises ValueError."""
    cursor = Cursor(content)
    first, last, size, crc = cursor.numbers(CHUNK_HEAD.format[1:])
    compression = cursor.text()
    (length,) = cursor.numbers("Q")
    if length != len(content) - cursor.at:
        raise ValueError(f"a chunk that says {length} bytes holds {len(content) - cursor.at}")
    if size > limit:
        raise ValueError(f"a chunk of {size} bytes, at most {limit} are allowed")
    data = _inflate(bytes(cursor.take(length)), compression, size)
    if crc and zlib.crc32(data) != crc:
        raise ValueError("a chunk with a wrong checksum")
    if last < first:
        raise ValueError("a chunk that ends before it starts")
    return data, bool(crc)


def _inflate(stored: bytes, compression: str, size: int) -> bytes:
    try:
        if compression == "zstd":
            if zstandard.frame_content_size(stored) not in (-1, size):
                raise ValueError("a chunk of another size than it says")
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
        raise ValueError("a chunk of another size than it says")
    return data


def cut(data: bytes, *, whole: bool) -> Records:
    """Cut bytes into records, up to the first that is no message, schema or channel, or not whole.

    With `whole` such a record is a ValueError.
    """
    places, definitions = [], []
    unpack, size, at = RECORD_HEAD.unpack_from, len(data), 0
    place, last = places.append, size - MESSAGE_HEAD.size
    while at <= last:
        opcode, length = unpack(data, at)
        end = at + 9 + length
        if end > size:
            break
        if opcode == MESSAGE and length >= 22:
            place(at)
        elif opcode in (SCHEMA, CHANNEL):
            definitions.append((opcode, data[at + RECORD_HEAD.size : end]))
        else:
            break
        at = end
    at = _short_ones(data, at, definitions)
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


def _short_ones(data: bytes, at: int, definitions: list[tuple[int, bytes]]) -> int:
    """Continue over schemas and channels at the end that are shorter than the head of a message."""
    while at + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        end = at + RECORD_HEAD.size + length
        if opcode not in (SCHEMA, CHANNEL) or end > len(data):
            break
        definitions.append((opcode, data[at + RECORD_HEAD.size : end]))
        at = end
    return at
