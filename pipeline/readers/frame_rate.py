"""The frame rate of a motion: stated, or as the file declares it."""

from __future__ import annotations

from pathlib import Path

from pipeline.clips.outcome import Reason
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.statement import Statement

STANDARD_HZ = (24, 25, 30, 50, 60, 90, 100, 120, 125, 200, 240, 250, 300, 400, 480, 500, 600, 960, 1000)
"""Rates at which motion is recorded or exported."""

ROUNDING = 1e-4
"""A rate this close to a whole number is that number: files print 1/30 s as 0.033333."""


def declared_rate(fps: float | None) -> float | None:
    """A declared rate [Hz] without the rounding of its printed digits."""
    if fps is None:
        return None
    return float(round(fps)) if abs(fps - round(fps)) < ROUNDING * fps else float(fps)


def printed_rate(printed: str) -> tuple[float, tuple[Reason, ...]]:
    """The rate [Hz] that a printed frame time stands for, with a note where its digits leave a choice.

    A program that prints 0.017 or 0.0083 meant 60 or 120 Hz: of the standard rates whose frame time rounds to the
    printed digits the only one is taken. Where several do (0.02 is 50 and 60 Hz) or none does, the quotient is taken.
    """
    frame_time_s = float(printed)
    fps = 1.0 / frame_time_s
    digits = printed.lower().partition("e")[0].partition(".")[2]
    if "e" in printed.lower() or (declared_rate(fps) in STANDARD_HZ and len(digits) > 3):
        return fps, ()
    half = 0.5 * 10.0 ** -len(digits)
    meant = [rate for rate in STANDARD_HZ if abs(1.0 / rate - frame_time_s) <= half * (1.0 + 1e-9)]
    if len(meant) == 1 and len(digits) <= 5:
        return float(meant[0]), ()
    if len(meant) < 2:
        return fps, ()
    choice = " and ".join(f"{rate} Hz" for rate in meant)
    text = f"Frame Time {printed} is rounded: {choice} are printed so; {fps:.4g} Hz is taken; state `fps:` for another"
    return fps, (Reason(code="rounded_rate", text=text, effect="noted", value=fps, unit="Hz"),)


def frame_rate(path: Path, declared: float | None, statement: Statement, fault: FileError | None = None) -> float:
    """Frames per second [Hz]; what is stated goes before what the file declares.

    `fault`: what is wrong with the file's own rate, where it has none that can be one. Raises it where no rate is
    stated, AmbiguousFileError when there is none, FileError when it is no rate.
    """
    if declared is None and statement.fps is None and fault is not None:
        raise fault
    fps = declared_rate(statement.fps if statement.fps is not None else declared)
    if fps is None:
        do = "State `fps:` for it in data/sources.yaml."
        raise AmbiguousFileError(path, "the file does not say its frame rate.", do)
    if not 1.0 <= fps <= 10_000.0:
        raise FileError(path, f"the frame rate is {fps:g} Hz, wanted 1 to 10000.", "State `fps:` in data/sources.yaml.")
    return fps
