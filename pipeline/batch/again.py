"""Clips that a run works on again although their answers are known: a person asked for it.

The names are in a JSON file, whose path the environment of the run holds; so the wish ends with the run, and an answer
is replaced only when its successor is there.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from pipeline.errors import FileError

AGAIN_VARIABLE = "BOOSTER_LAB_AGAIN"
"""Path of a JSON file: a list of the clips that each stage works on again."""


def clips_again() -> frozenset[str]:
    """The clips that this run works on again. Raises FileError for a file that is not such a list."""
    named = os.environ.get(AGAIN_VARIABLE, "")
    if not named:
        return frozenset()
    try:
        found = json.loads(Path(named).read_text())
    except (OSError, ValueError) as error:
        raise FileError(Path(named), f"can't be read ({error}).", f"Unset {AGAIN_VARIABLE}.") from error
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise FileError(Path(named), "is no list of clips.", f"Unset {AGAIN_VARIABLE}.")
    return frozenset(found)
