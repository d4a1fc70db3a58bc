"""JSON files, which may come from others: their size is checked before memory is taken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn

from pipeline.errors import FileError

MAX_BYTES = 50_000_000
"""Of a file: a database's manifest of 400,000 clips, or a clip of half an hour."""


def read_json(path: Path, what: str = "JSON", do: str = "") -> Any:
    """The value of a file.

    Raises FileError for a file that is missing, too large, nested too deeply or no JSON, as NaN and infinities are.

    Args:
        what: what the file has to be, for the sentence
        do: what a person is to do about one that is not
    """
    if not path.is_file():
        raise FileError(path, "the file does not exist.", do)
    if path.stat().st_size > MAX_BYTES:
        raise FileError(path, f"the file is larger than the {MAX_BYTES} bytes allowed.", do)
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"not {what} ({error}).", do) from error


def _refuse(text: str) -> NoReturn:
    raise ValueError(f"{text} is not a JSON number")
