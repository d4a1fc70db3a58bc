"""The frame rate of a motion: stated, or as the file declares it."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.statement import Statement

ROUNDING = 1e-4
"""A rate this close to a whole number is that number: files print 1/30 s as 0.033333."""


def declared_rate(fps: float | None) -> float | None:
    """A declared rate [Hz] without the rounding of its printed digits."""
    if fps is None:
        return None
    return float(round(fps)) if abs(fps - round(fps)) < ROUNDING * fps else float(fps)


def frame_rate(path: Path, declared: float | None, statement: Statement) -> float:
    """Frames per second [Hz]; what is stated goes before what the file declares.

    Raises AmbiguousFileError when there is none, FileError when it is no rate.
    """
    fps = declared_rate(statement.fps if statement.fps is not None else declared)
    if fps is None:
        do = "State `fps:` for it in data/sources.yaml."
        raise AmbiguousFileError(path, "the file does not say its frame rate.", do)
    if not 1.0 <= fps <= 10_000.0:
        raise FileError(path, f"the frame rate is {fps:g} Hz, wanted 1 to 10000.", "State `fps:` in data/sources.yaml.")
    return fps
