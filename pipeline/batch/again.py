"""Clips that a run recomputes on request although their results are cached.

The names are in a JSON file whose path is in an environment variable of the run, so the request ends with the run. A
cached result is replaced only when the new one exists.
"""

import json
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pipeline.batch.shard import source_of
from pipeline.errors import FileError

AGAIN_VARIABLE = "BOOSTER_LAB_AGAIN"
"""Path of a JSON file: a list of clips that each stage recomputes; `name/` means all clips of a source."""


@dataclass(frozen=True)
class ClipsAgain:
    """Set of clips that a run recomputes, by clip or source name."""

    names: frozenset[str] = frozenset()

    def __contains__(self, clip: str) -> bool:
        return bool(self.names) and (clip in self.names or f"{source_of(clip)}/" in self.names)

    def __bool__(self) -> bool:
        return bool(self.names)


def clips_again() -> ClipsAgain:
    """Clips that this run recomputes. Raises FileError if the file is not such a list."""
    named = os.environ.get(AGAIN_VARIABLE, "")
    if not named:
        return ClipsAgain()
    try:
        found = json.loads(Path(named).read_text())
    except (OSError, ValueError) as error:
        raise FileError(Path(named), f"can't be read ({error}).", f"Unset {AGAIN_VARIABLE}.") from error
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise FileError(Path(named), "is no list of clips.", f"Unset {AGAIN_VARIABLE}.")
    return ClipsAgain(frozenset(found))


@contextmanager
def working_again_on(names: Sequence[str]) -> Iterator[None]:
    """Context in which stages of this process recompute the named clips and sources (`name/`)."""
    before = os.environ.get(AGAIN_VARIABLE)
    with tempfile.TemporaryDirectory(prefix="booster_lab_again_") as folder:
        listed = Path(folder) / "clips.json"
        listed.write_text(json.dumps(list(names)))
        os.environ[AGAIN_VARIABLE] = str(listed)
        try:
            yield
        finally:
            os.environ.pop(AGAIN_VARIABLE)
            if before is not None:
                os.environ[AGAIN_VARIABLE] = before
