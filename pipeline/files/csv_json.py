"""Read CSV and JSON files written by users: limited size, UTF-8, every fault of a table with its line."""

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NoReturn

from pipeline.errors import FileError
from pipeline.files import atomic
from pipeline.files.settings import DECIMAL

MAX_BYTES = 50_000_000
"""Largest size of a table; a motor's sweep or a robot's joints have a few thousand rows."""


def read_csv_text(path: Path) -> str:
    """The text of a file. Raises FileError if it is too large, or with the line of the first invalid UTF-8."""
    if path.stat().st_size > MAX_BYTES:
        raise FileError(path, f"the file has {path.stat().st_size} bytes, more than the {MAX_BYTES} allowed.")
    data = path.read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        problem = f"the byte 0x{data[error.start]:02x} is no UTF-8 text."
        raise FileError(path, problem, "Save the table as UTF-8 (in a spreadsheet: 'CSV UTF-8').", line) from error


def plain_number(text: str) -> float:
    """The number in a cell, in the notation of settings files.

    Raises ValueError for `1_0`, `nan` or digits of other scripts, which `float` accepts, and for overflow.
    """
    value = float(text) if DECIMAL.match(text) else float("nan")
    if not math.isfinite(value):
        raise ValueError(f"'{text[:40]}' is no finite decimal number")
    return value


def plain_integer(text: str) -> int:
    """The whole number in a cell. Raises ValueError."""
    value = plain_number(text)
    if value != int(value):
        raise ValueError(f"'{text[:40]}' is no whole number")
    return int(value)


def csv_records(
    lines: Iterable[str], path: Path | str, delimiter: str = ",", first_line: int = 1
) -> Iterator[list[str]]:
    """Records of a table. Raises FileError with the line if a field is too long or a quote is not closed.

    Args:
        path: path of the file, for messages
        first_line: number of the first of `lines` in the file
    """
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        yield from reader
    except csv.Error as error:
        line = first_line + max(reader.line_num - 1, 0)
        raise FileError(path, f"the row can't be read ({error}).", "Shorten or correct it.", line) from error


MAX_JSON_BYTES = 50_000_000
"""Largest size of a file: a database's manifest of 400,000 clips, or a clip of half an hour."""


def read_json(path: Path, what: str = "JSON", do: str = "", most_bytes: int = MAX_JSON_BYTES) -> Any:
    """The value of a JSON file.

    Raises FileError for a file that is missing, too large, nested too deeply or not JSON; NaN and infinities are not
    JSON.

    Args:
        what: the expected content, as the error names it
        do: the remedy that the error names
        most_bytes: largest size of the file
    """
    if not path.is_file():
        raise FileError(path, "the file does not exist.", do)
    if path.stat().st_size > most_bytes:
        raise FileError(path, f"the file is larger than the {most_bytes} bytes allowed.", do)
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"not {what} ({error}).", do) from error


def json_text(value: Any) -> str:
    """A value as JSON with sorted keys. Raises ValueError for NaN and infinities."""
    return json.dumps(value, indent=1, sort_keys=True, allow_nan=False) + "\n"


def write_json(path: Path, value: Any) -> None:
    """Write `json_text` of a value atomically."""
    atomic.write_text(path, json_text(value))


def without_nan(value: Any) -> Any:
    """A value as JSON types: None in place of NaN and infinities, Python's numbers in place of numpy's."""
    if isinstance(value, Mapping):
        return {str(key): without_nan(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(each) for each in value]
    plain = value.item() if hasattr(value, "item") else value
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain


def _refuse(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a JSON number")
