"""Find where reading can continue behind damage: the next chunk whose checksum holds, or the next head of a message."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import BinaryIO

from pipeline.hardware_logs.log_report import Bounds
from pipeline.hardware_logs.mcap_chunk import open_chunk
from pipeline.hardware_logs.mcap_records import CHUNK, CHUNK_HEAD, MESSAGE, MESSAGE_HEAD, RECORD_HEAD

BLOCK = 1 << 20
KINDS = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
"""A chunk's compression as it is written; the record starts `BEFORE` bytes earlier."""
BEFORE = RECORD_HEAD.size + CHUNK_HEAD.size
HEAD_BYTES = 11
"""Opcode, length and channel of a message."""
MAX_TRIED = 1_000
"""Places of one file that are inflated to see whether they are chunks."""


class Resync:
    """Searches one file; counts what it tried."""

    def __init__(self, stream: BinaryIO, size: int, bounds: Bounds):
        self._stream, self._size, self._bounds = stream, size, bounds
        self._tried = 0

    def chunk(self, start: int, offsets: Iterable[int]) -> int | None:
        """First chunk with a checksum that holds, at or behind `start`; None where there is none.

        Args:
            offsets: places to try besides those that look like a chunk, in ascending order
        """
        looks = (each - BEFORE for each in self._find(KINDS, start + BEFORE))
        stated = (each for each in offsets if each >= start)
        found = [at for places in (looks, stated) if (at := self._first_chunk(places)) is not None]
        return min(found, default=None)

    def message(self, start: int, lengths: Iterable[tuple[int, int]]) -> int | None:
        """First place that begins as a message does that was met before: of such a length and channel."""
        heads = [MESSAGE_HEAD.pack(MESSAGE, length, channel, 0, 0, 0)[:HEAD_BYTES] for length, channel in lengths]
        return next(self._find(heads, start), None)

    def _first_chunk(self, places: Iterable[int]) -> int | None:
        for at in places:
            self._tried += 1
            if self._tried > MAX_TRIED:
                return None
            if self._is_chunk(at):
                return at
        return None

    def _is_chunk(self, at: int) -> bool:
        self._stream.seek(at)
        head = self._stream.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
        if opcode != CHUNK or length > min(self._bounds.record_bytes, self._size - at):
            return False
        try:
            return open_chunk(self._stream.read(length), self._bounds.record_bytes).has_crc
        except ValueError:
            return False

    def _find(self, patterns: Iterable[bytes], start: int) -> Iterator[int]:
        """Places of any of the patterns from `start` on, in ascending order."""
        patterns = tuple(patterns)
        overlap = max(map(len, patterns), default=1) - 1
        for block in range(start, self._size, BLOCK):
            self._stream.seek(block)
            data, found = self._stream.read(BLOCK + overlap), set()
            for pattern in patterns:
                at = data.find(pattern)
                while 0 <= at < BLOCK:
                    found.add(block + at)
                    at = data.find(pattern, at + 1)
            yield from sorted(found)
