"""Text of a motion file: size checked first, BOM and line ends dealt with once for all formats."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.errors import FileError
from pipeline.files.array_file import known_numbers
from pipeline.readers.decimal_rows import read_decimals

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
