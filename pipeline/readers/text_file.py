"""Text of a motion file: size and encoding are checked once, for all formats; whole, by blocks, or as rows of numbers.

Decimals are read in a third of the time of `float`, with the same bits: a decimal of at most 15 digits is an integer
below 2^53 over a power of ten of at most 10^15. Both are exact in a double and one division rounds once, so the
quotient is the nearest double (Clinger 1990, the fast path of `strtod`).
"""

from __future__ import annotations

import codecs
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8

from pipeline.errors import FileError
from pipeline.files.array_file import known_numbers

MOST_DIGITS = 15
"""Of one number; integers of as many are below 2^53."""

LINES_AT_ONCE = 128
"""Some 100 kB of text: what is computed from it stays in the processor's cache."""

POWERS = 10.0 ** np.arange(MOST_DIGITS + 1)
BLANKS, DIGITS = b" \t\n", b"0123456789"


def read_decimals(lines: list[str], columns: int) -> Float[np.ndarray, "t columns"] | None:
    """Rows of `columns` decimals (`-12.5`, `3`, `.25`) between blanks and tabs; lines without a number are skipped.

    None where anything is written in another way, or a row has another length: the caller then reads word by word.
    """
    parts = []
    for first in range(0, len(lines), LINES_AT_ONCE):
        part = _decimals("\n".join(lines[first : first + LINES_AT_ONCE]) + "\n", columns)
        if part is None:
            return None
        parts.append(part)
    return np.concatenate(parts) if parts else None


def _decimals(lines: str, columns: int) -> Float[np.ndarray, "t columns"] | None:
    """The rows of a text of whole lines; None for any other form."""
    data = lines.encode()
    if data.translate(None, BLANKS + DIGITS + b".-"):
        return None
    text = np.frombuffer(data, dtype=np.uint8)
    line_end, minus = text == ord("\n"), text == ord("-")
    blank = (text == ord(" ")) | (text == ord("\t")) | line_end
    edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
    edges = edges if blank[0] else np.concatenate([[0], edges])
    starts, stops = edges[::2], edges[1::2]
    in_row = np.diff(np.searchsorted(starts, np.flatnonzero(line_end)), prepend=0)
    if not ((in_row == columns) | (in_row == 0)).all():
        return None
    negative, points = minus[starts], np.flatnonzero(text == ord("."))
    pointed = np.searchsorted(starts, points, side="right") - 1
    if np.count_nonzero(minus) != np.count_nonzero(negative) or (np.diff(pointed) == 0).any():
        return None
    decimals, counts = np.zeros(len(starts), dtype=int), stops - starts - negative
    decimals[pointed] = stops[pointed] - 1 - points
    counts[pointed] -= 1
    if counts.min(initial=1) < 1 or counts.max(initial=1) > MOST_DIGITS:
        return None
    digits = np.frombuffer(data.translate(None, BLANKS + b".-"), dtype=np.uint8) - np.uint8(ord("0"))
    number = _integers(digits, counts) / POWERS[decimals]
    return np.where(negative, -number, number).reshape(-1, columns)


def _integers(digits: UInt8[np.ndarray, " d"], counts: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Whole numbers of `counts` digits each, from all their digits one after another."""
    last = np.cumsum(counts) - 1
    total = digits[last].astype(float)
    least, most = counts.min(initial=MOST_DIGITS), counts.max(initial=1)
    for place in range(1, most):
        worth = digits.take(last - place, mode="wrap") * POWERS[place]
        total += worth if place < least else np.where(counts > place, worth, 0.0)
    return total


MAX_BYTES = 400_000_000
MAX_FRAMES = 2_000_000
MAX_NUMBERS = 100_000_000
"""Caps that are checked before memory is taken: 2,000,000 frames are 4.6 hours at 120 Hz."""


def read_lines(path: Path) -> list[str]:
    """Lines of a text file without their ends. Raises FileError: missing, empty, too large, not text."""
    return read_text(path).split("\n")


def read_text(path: Path) -> str:
    """A text file with `\\n` at the ends of its lines. Raises FileError: missing, empty, too large, not text."""
    check_size(path)
    data = path.read_bytes()
    if b"\0" in data:
        raise FileError(path, "the file is not text: it contains zero bytes.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    del data
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def check_size(path: Path) -> None:
    """Raises FileError for a file that is missing, empty or too large."""
    if not path.is_file():
        raise FileError(path, "the file does not exist.")
    size = path.stat().st_size
    if size == 0:
        raise FileError(path, "the file is empty.")
    if size > MAX_BYTES:
        raise FileError(path, f"the file has {size} bytes, more than the {MAX_BYTES} allowed.", "Split it.")


def to_float(token: str) -> float:
    """`float` without what only Python takes for a number: `1_0`, digits of other scripts. Raises ValueError."""
    if "_" in token or not token.isascii():
        raise ValueError(f"not a number: {token[:40]!r}")
    try:
        return float(token)
    except ValueError:
        raise ValueError(f"not a number: {token[:40]!r}") from None


def read_number(path: Path, token: str, line: int, what: str) -> float:
    """A finite number. Raises FileError with the line."""
    try:
        number = to_float(token)
    except ValueError:
        number = float("nan")
    if not np.isfinite(number):
        raise FileError(path, f"{what} is '{token[:40]}', wanted a finite number.", line=line)
    return number


def read_rows(
    path: Path, lines: list[str], first_line: int, columns: int, last: bool = True
) -> Float[np.ndarray, "t columns"]:
    """Rows of `columns` numbers each; blank lines are skipped, `nan`, `inf` and huge numbers become NaN.

    `first_line` is the number of `lines[0]` in the file, counted from 1; `last`: no row follows these lines. Raises
    FileError with the line for a row that is too short or too long and for what is not a number.
    """
    plain = read_decimals(lines, columns)
    if plain is not None:
        return plain

    def rows() -> Iterator[list[str]]:
        for line in lines:
            tokens = line.split()
            if len(tokens) == columns and line.isascii() and "_" not in line:
                yield tokens
            elif tokens:
                raise ValueError

    try:
        values = np.fromiter(map(float, itertools.chain.from_iterable(rows())), dtype=float).reshape(-1, columns)
    except ValueError:
        _refuse_bad_row(path, lines, first_line, columns, last)
        raise
    return known_numbers(values)


def _refuse_bad_row(path: Path, lines: list[str], first_line: int, columns: int, last: bool) -> None:
    """Raises FileError for the first row that is too short, too long or not of numbers."""
    for number, line in enumerate(lines, start=first_line):
        tokens = line.split()
        if len(tokens) not in (0, columns):
            cut = last and not any(rest.strip() for rest in lines[number - first_line + 1 :])
            hint = " It is the last row: the file was cut off." if cut else ""
            raise FileError(path, f"the row has {len(tokens)} numbers, wanted {columns}.{hint}", line=number)
        try:
            for token in tokens:
                to_float(token)
        except ValueError as error:
            hint = "Write decimals with a point, not a comma." if "," in line else ""
            raise FileError(path, f"{error}.", hint, number) from error


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
