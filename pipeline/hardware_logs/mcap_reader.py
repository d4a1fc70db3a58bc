"""Read the data section of an MCAP file in bounded memory, without relying on indices; all checksums are checked.

Damage is skipped: reading continues at the next chunk with a correct checksum, or at the next message header. Each such
position is reported as a `Loss` between the records.
"""

import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Metadata

from pipeline.hardware_logs.log_report import Bounds, LogReport, Loss
from pipeline.hardware_logs.mcap_records import (
    CHUNK_HEAD,
    DEFINITIONS,
    MAGIC,
    MESSAGE_HEAD,
    RECORD_HEAD,
    Channels,
    Fields,
    Records,
    Summary,
    cut,
    open_chunk,
    read_summary,
)

KINDS = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
"""Encoded compression field of a chunk; the record starts `BEFORE` bytes earlier."""
BEFORE = RECORD_HEAD.size + CHUNK_HEAD.size
HEAD_BYTES = 11
"""Bytes of a message's opcode, length and channel."""
MAX_TRIED = 1_000
"""Most positions of a file that are decompressed to test for a chunk."""


BLOCK = 1 << 20
"""Bytes of records outside chunks that are read at once, unless a record is longer."""
HEAD = RECORD_HEAD.size


class McapReader:
    """One pass over a file. Iterate over `read()`, which also fills `channels` and `metadata`."""

    def __init__(self, path: Path, report: LogReport):
        self.path, self.report = path, report
        self.channels = Channels()
        self.metadata: dict[str, dict[str, str]] = {}
        self.contradicted: set[str] = set()
        """Names of metadata records that contradict another one."""
        self.summary: Summary | None = None
        self._inflated, self._tried = 0, 0
        self._counts: Counter[int] = Counter()
        self._lengths: set[tuple[int, int]] = set()
        """Record length and channel of messages outside chunks."""

    def read(self) -> Iterator[Records | Loss]:
        """Yield messages in file order and the losses between them. Raises LogError if the file is not MCAP."""
        with self.path.open("rb") as self._stream:
            self._size = self.path.stat().st_size
            if self._bytes(0, 8) != MAGIC:
                raise self.report.refuse("not an MCAP file: it does not begin with the magic", "Is it another format?")
            self.summary = read_summary(self._stream, self._size)
            for opcode, content in self.summary.definitions if self.summary else ():
                self.channels.define(opcode, content)
            yield from self._walk()

    def _walk(self) -> Iterator[Records | Loss]:
        at = len(MAGIC)
        while True:
            head = self._bytes(at, HEAD)
            self.report.offset = at
            opcode, length = RECORD_HEAD.unpack(head) if len(head) == HEAD else (0, 0)
            if opcode == Opcode.DATA_END and length == 4:
                yield from self._end(at)
                return
            if not self._is_record(opcode, length, at):
                found = self._next(at + 1)
                yield self.report.lose(at, "a damaged record" if found else "the file ends or can't be read further")
                if found is None:
                    return
                at = found
            elif opcode in (Opcode.MESSAGE, *DEFINITIONS):
                records = cut(self._bytes(at, max(BLOCK, HEAD + length)), whole=False)
                self._note_bare(records)
                yield from self._take(records, at)
                at += records.end or HEAD + length
            else:
                if opcode == Opcode.CHUNK:
                    yield from self._chunk(at, length)
                elif opcode == Opcode.METADATA:
                    yield from self._metadata(at, length)
                at += HEAD + length

    def _next(self, start: int) -> int | None:
        """Position at which reading can continue; in a file with chunk checksums only at such a chunk.

        Messages outside chunks are found by their header, with a length and channel that occurred before.
        """
        if self._lengths and not self.report.checked:
            heads = (MESSAGE_HEAD.pack(Opcode.MESSAGE, length, each, 0, 0, 0) for length, each in self._lengths)
            return next(self._find([head[:HEAD_BYTES] for head in heads], start), None)
        looks = (each - BEFORE for each in self._find(KINDS, start + BEFORE))
        stated = (each for each in (self.summary.chunk_offsets if self.summary else ()) if each >= start)
        found = [at for places in (looks, stated) if (at := self._first_chunk(places)) is not None]
        return min(found, default=None)

    def _first_chunk(self, places: Iterable[int]) -> int | None:
        """The first position with a chunk whose checksum is correct."""
        for at in places:
            self._tried += 1
            if self._tried > MAX_TRIED:
                return None
            if self._is_chunk(at):
                return at
        return None

    def _is_chunk(self, at: int) -> bool:
        head = self._bytes(at, HEAD)
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == HEAD else (0, 0)
        if opcode != Opcode.CHUNK or length > min(Bounds.record_bytes, self._size - at):
            return False
        try:
            return open_chunk(self._stream.read(length), Bounds.record_bytes)[1]
        except ValueError:
            return False

    def _find(self, patterns: Sequence[bytes], start: int) -> Iterator[int]:
        """Positions of any of the patterns from `start`, ascending."""
        overlap = max(map(len, patterns), default=1) - 1
        for block in range(start, self._size, BLOCK):
            data, found = self._bytes(block, BLOCK + overlap), set()
            for pattern in patterns:
                at = data.find(pattern)
                while 0 <= at < BLOCK:
                    found.add(block + at)
                    at = data.find(pattern, at + 1)
            yield from sorted(found)

    def _is_record(self, opcode: int, length: int, at: int) -> bool:
        """Whether a record of the data section may start here."""
        if length > min(Bounds.record_bytes, self._size - at - HEAD):
            return False
        if opcode == Opcode.MESSAGE_INDEX:
            size = int.from_bytes(self._bytes(at + HEAD + 2, 4), "little")
            return length >= 6 and size == length - 6 and size % 16 == 0
        if opcode == Opcode.HEADER:
            return at == len(MAGIC)
        if opcode == Opcode.MESSAGE:
            return length >= 22
        return opcode in (*DEFINITIONS, Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA)

    def _bytes(self, at: int, size: int) -> bytes:
        self._stream.seek(at)
        return self._stream.read(size)

    def _note_bare(self, records: Records) -> None:
        """Record length and channel of messages outside chunks, to find further ones after damage."""
        if len(records.channel):
            self.report.unchecked += 1
            lengths = (records.stop - records.start + MESSAGE_HEAD.size - HEAD).tolist()
            if len(self._lengths) < Bounds.channels:
                self._lengths.update(zip(lengths, records.channel.tolist(), strict=True))

    def _chunk(self, at: int, length: int) -> Iterator[Records | Loss]:
        try:
            data, has_crc = open_chunk(self._bytes(at + HEAD, length), Bounds.record_bytes)
            if self.report.checked and not has_crc:
                raise ValueError("a chunk without a checksum, though others have theirs")
            records = cut(data, whole=True)
        except ValueError as error:
            yield self.report.lose(at, str(error))
            return
        self._inflated += len(data)
        if self._inflated > Bounds.total_bytes:
            raise self.report.refuse(f"more than {Bounds.total_bytes} bytes after inflation")
        if has_crc:
            self.report.checked += 1
        else:
            self.report.unchecked += 1
        if self.report.checked + self.report.unchecked > Bounds.chunks:
            raise self.report.refuse(f"more than {Bounds.chunks} chunks")
        yield from self._take(records, at)

    def _take(self, records: Records, at: int) -> Iterator[Records | Loss]:
        """Definitions first, then the messages."""
        for opcode, content in records.definitions:
            try:
                self.channels.define(opcode, content)
            except ValueError as error:
                yield self.report.lose(at, f"a schema or channel that can't be read ({error})")
        self._counts.update(records.channel.tolist())
        if self._counts.total() > Bounds.messages:
            raise self.report.refuse(f"more than {Bounds.messages} messages")
        if len(records.channel):
            yield records

    def _metadata(self, at: int, length: int) -> Iterator[Loss]:
        try:
            found = Metadata.read(Fields(self._bytes(at + HEAD, length)))
        except ValueError:
            yield self.report.lose(at, "a metadata record that can't be read")
            return
        if self.metadata.setdefault(found.name, found.metadata) != found.metadata:
            self.contradicted.add(found.name)

    def _end(self, at: int) -> Iterator[Loss]:
        """Compare what was read with the checksum of the data section and with the statistics."""
        self.report.ended = True
        crc = int.from_bytes(self._bytes(at + HEAD, 4), "little")
        if crc and self.report.unchecked:
            self.report.whole_checked = self._crc(at) == crc
            if not self.report.whole_checked:
                yield self.report.lose(at, "the checksum of all messages is wrong")
        if self.summary is None:
            yield self.report.lose(at, "the summary is missing or damaged")
        elif self.summary.counts is not None and not self.report.losses:
            missing = Counter(self.summary.counts)
            missing.subtract(self._counts)
            if any(missing.values()):
                stated, read = sum(self.summary.counts.values()), self._counts.total()
                yield self.report.lose(at, f"the file states {stated} messages, {read} are there")

    def _crc(self, stop: int) -> int:
        """CRC-32 of the file up to `stop`."""
        crc, at = 0, 0
        while at < stop:
            data = self._bytes(at, min(BLOCK, stop - at))
            crc, at = zlib.crc32(data, crc), at + len(data)
        return crc
