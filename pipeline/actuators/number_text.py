"""Parse numbers with a decimal point or a decimal comma, without guessing."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from pipeline.errors import AmbiguousFileError, FileError

DECIMALS = {"point": ".", "comma": ","}
"""Allowed values of `decimal`."""

_POINT = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(\d+(,\d*)?|,\d+)([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}[,.]\d{3}")


def decimal_sign(texts: Sequence[str], stated: str | None, file: str) -> str:
    """`.` or `,`: the decimal sign of all these numbers. Raises FileError if ambiguous.

    "1,234" may be a thousand or one and a bit: where every number with a comma is like that, the file must say which.
    """
    if stated is not None:
        if stated not in DECIMALS:
            raise FileError(file, f"it states the decimal sign '{stated}'.", "Write '# decimal: point' or ': comma'.")
        return DECIMALS[stated]
    with_comma = [text for text in texts if "," in text]
    with_point = [text for text in texts if "." in text]
    if with_comma and with_point:
        problem = f"it has numbers with a comma ('{with_comma[0]}') and with a point ('{with_point[0]}')."
        raise AmbiguousFileError(file, problem, "Write all with the same decimal sign and no thousands separator.")
    if with_comma and all(_THOUSANDS.fullmatch(text) for text in with_comma):
        problem = f"the comma in '{with_comma[0]}' may separate thousands or decimals."
        raise AmbiguousFileError(file, problem, "Write a line '# decimal: comma', or use decimal points.")
    return "," if with_comma else "."


def number(text: str, sign: str, what: str, file: str, line: int) -> float:
    """The finite number in `text`. Raises FileError with the line."""
    pattern = _COMMA if sign == "," else _POINT
    if pattern.fullmatch(text):
        value = float(text.replace(",", "."))
        if math.isfinite(value):
            return value
    raise FileError(file, f"{what} is '{text}'.", "Write a finite number or remove the row.", line)
