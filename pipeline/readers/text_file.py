"""Read the text of a motion file (whole, by lines, or as rows of numbers) with checks of size and encoding."""

import codecs
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from jaxtyping import Float

from pipeline.errors import FileError
from pipeline.files import page_memory
from pipeline.files.array_file import known_numbers

MAX_BYTES = 400_000_000
MAX_FRAMES = 2_000_000
MAX_NUMBERS = 100_000_000
"""Limits checked before memory is allocated: 2,000,000 frames are 4.6 hours at 120 Hz."""


LINES_AT_ONCE = 256
"""Lines per batch; Arrow needs ten times their size."""


def read_lines(path: Path) -> list[str]:
    """Lines of a text file without their ends. Raises FileError: missing, empty, too large, not text."""
    return read_text(path).split("\n")


def read_text(path: Path) -> str:
    """A text file with `\\n` at the ends of its lines. Raises FileError: missing, empty, too large, not text."""
    return path.read_text(encoding=open_text(path).encoding)


def check_size(path: Path) -> None:
    """Raise FileError for a file that is missing, empty or too large."""
    if not path.is_file():
        raise FileError(path, "the file does not exist.")
    size = path.stat().st_size
    if size == 0:
        raise FileError(path, "the file is empty.")
    if size > MAX_BYTES:
        raise FileError(path, f"the file has {size} bytes, more than the {MAX_BYTES} allowed.", "Split it.")


def to_float(token: str) -> float:
    """`float` that rejects Python-only number syntax: `1_0`, digits of other scripts. Raises ValueError."""
    if "_" in token or not token.isascii():
        raise ValueError(f"not a number: {token[:40]!r}")
    try:
        return float(token)
    except ValueError:
        raise ValueError(f"not a number: {token[:40]!r}") from None


def read_number(path: Path, token: str, line: int, what: str) -> float:
    """Parse a finite number. Raises FileError with the line."""
    try:
        number = to_float(token)
    except ValueError:
        number = float("nan")
    if not np.isfinite(number):
        raise FileError(path, f"{what} is '{token[:40]}', expected a finite number.", line=line)
    return number


def read_table(
    path: Path,
    lines: Iterator[tuple[int, str]],
    most_lines: int,
    columns: int,
    comma: bool = False,
    any_size: int | None = None,
) -> Float[np.ndarray, "t columns"]:
    """Rows of `columns` numbers each between blanks or commas, in memory that `page_memory.forget` frees.

    `lines` come with their numbers, at most `most_lines`. Blank ones are skipped; `nan`, `inf` and huge numbers become
    NaN, but for those of the column `any_size`. Raises FileError with the line for a row that is too short or too long
    and for what is not a number.
    """
    by_size = path.stat().st_size // (2 * columns) + 1  # a number takes two bytes
    rows = page_memory.empty((min(most_lines, by_size, MAX_FRAMES + 1, MAX_NUMBERS // columns + 1), columns))
    count, (number, first) = 0, next(lines, (0, ""))
    for block, last in _blocks(chain([first], (line for _, line in lines)), LINES_AT_ONCE):
        part = parsed_rows(block, columns, comma)
        if part is None:
            part = _rows_word_by_word(path, block, number, columns, last, comma)
        check_numbers(path, count + len(part), columns)
        rows[count : count + len(part)] = known_numbers(part)
        if any_size is not None:
            rows[count : count + len(part), any_size] = part[:, any_size]
        count, number = count + len(part), number + len(block)
    return rows[:count]


def check_numbers(path: Path, frames: int, columns: int) -> None:
    """Raise FileError for more frames or numbers than allowed."""
    if frames * columns > MAX_NUMBERS or frames > MAX_FRAMES:
        problem = f"{frames} frames of {columns} numbers are more than the {MAX_NUMBERS} allowed."
        raise FileError(path, problem, "Split it.")


def parsed_rows(lines: list[str], columns: int, comma: bool = False) -> Float[np.ndarray, "t columns"] | None:
    """Rows of `columns` numbers by Arrow's parser; bit-identical to `float`, 3x faster.

    None if a row has another length or Arrow can't read a number. Uses buffers and DLPack, since Arrow would import
    pandas (45 MB) to convert Python objects.
    """
    data = "\n".join(filter(None, map(str.strip, lines))).encode()
    if not data:
        return np.zeros((0, columns))
    ends = pa.py_buffer(np.array([0, len(data)], dtype=np.int32))
    text = pc.split_pattern(pa.StringArray.from_buffers(1, ends, pa.py_buffer(data)), "\n").values
    rows = pc.split_pattern(text, ",") if comma else pc.ascii_split_whitespace(text)
    if (np.from_dlpack(pc.list_value_length(rows)) != columns).any():
        return None
    try:
        numbers = pc.ascii_trim_whitespace(rows.values).cast(pa.float64())
    except pa.ArrowInvalid:
        return None
    return np.from_dlpack(numbers).reshape(-1, columns)


def _rows_word_by_word(
    path: Path, lines: list[str], first_line: int, columns: int, last: bool, comma: bool
) -> Float[np.ndarray, "t columns"]:
    """The rows as `float` reads them. Raises FileError for the first that is too short, too long or not of numbers.

    `first_line` is the number of `lines[0]` in the file, counted from 1; `last`: no row follows these lines.
    """
    rows = []
    for number, line in enumerate(lines, start=first_line):
        tokens = [cell.strip() for cell in line.split(",")] if comma and line.strip() else line.split()
        if len(tokens) not in (0, columns):
            cut = last and not any(rest.strip() for rest in lines[number - first_line + 1 :])
            hint = " It is the last row: the file was cut off." if cut else ""
            raise FileError(path, f"the row has {len(tokens)} numbers, expected {columns}.{hint}", line=number)
        try:
            rows += [to_float(token) for token in tokens]
        except ValueError as error:
            hint = "Write decimals with a point, not a comma." if "," in line and not comma else ""
            raise FileError(path, f"{error}.", hint, number) from error
    return np.array(rows).reshape(-1, columns)


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
                do = "Save it as UTF-8 if it is UTF-16; unpack it if it is packed."
                raise FileError(path, "the file is not text: it contains zero bytes.", do)
            ends += block.count(b"\n") + block.count(b"\r")
            if encoding == "utf-8-sig":
                try:
                    decoder.decode(block)
                except UnicodeDecodeError:
                    encoding = "latin-1"
    if encoding == "utf-8-sig" and decoder.getstate()[0]:
        encoding = "latin-1"  # it ends within a character
    return MotionText(path=path, encoding=encoding, line_count=ends + 1)


def _blocks(lines: Iterator[str], size: int) -> Iterator[tuple[list[str], bool]]:
    """Blocks of `size` lines, each with a flag for the last block that is not blank."""
    block = list(islice(lines, size))
    while block:
        following = list(islice(lines, size))
        while following and not any(line.strip() for line in following):
            block += following
            following = list(islice(lines, size))
        yield block, not following
        block = following
