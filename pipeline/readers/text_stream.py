"""Text of a large motion file as a stream of lines: checked once from end to end, then read block by block."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from pipeline.errors import FileError
from pipeline.readers.text_file import check_size

SCANNED_BYTES = 1 << 20


@dataclass(frozen=True, kw_only=True)
class MotionText:
    """A text file that was checked: not empty, not too large, without zero bytes, in UTF-8 or Latin-1."""

    path: Path
    encoding: str
    line_count: int
    """Upper bound on the number of lines."""

    def lines(self) -> Iterator[str]:
        """Lines without their ends (`\\n`, `\\r\\n` or `\\r`)."""
        with self.path.open(encoding=self.encoding, newline=None) as stream:
            for line in stream:
                yield line.removesuffix("\n")


def open_text(path: Path) -> MotionText:
    """Check a text file. Raises FileError: missing, empty, too large, not text."""
    check_size(path)
    decoder, encoding, ends = codecs.getincrementaldecoder("utf-8")(), "utf-8-sig", 0
    with path.open("rb") as stream:
        while block := stream.read(SCANNED_BYTES):
            if b"\0" in block:
                raise FileError(path, "the file is not text: it contains zero bytes.")
            ends += block.count(b"\n") + block.count(b"\r")
            if encoding == "utf-8-sig":
                try:
                    decoder.decode(block)
                except UnicodeDecodeError:
                    encoding = "latin-1"
    if encoding == "utf-8-sig" and decoder.getstate()[0]:
        encoding = "latin-1"  # it ends within a character
    return MotionText(path=path, encoding=encoding, line_count=ends + 1)


def blocks(lines: Iterator[str], size: int) -> Iterator[tuple[list[str], bool]]:
    """Lines in blocks of `size`, each with whether it is the last one that holds anything but blanks."""
    block = list(islice(lines, size))
    while block:
        following = list(islice(lines, size))
        while following and not any(line.strip() for line in following):
            block += following
            following = list(islice(lines, size))
        yield block, not following
        block = following
