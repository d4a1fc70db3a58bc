"""The frame rate of a motion: stated, declared by the file, or checked against the file's velocities."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.clips.outcome import Reason
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.files.array_file import finite_rows
from pipeline.readers.source import Statement

STANDARD_HZ = (24, 25, 30, 50, 60, 90, 100, 120, 125, 200, 240, 250, 300, 400, 480, 500, 600, 960, 1000, 2000)
"""Rates at which motion is recorded or exported."""

ROUNDING = 1e-4
"""Deviation up to which a rate is rounded to an integer, since files print 1/30 s as 0.033333."""

STATE_RATE = "State `fps:` for it in data/sources.yaml."
"""Remedy for a missing or wrong rate."""


def declared_rate(fps: float | None) -> float | None:
    """A declared rate [Hz] corrected for the rounding of its printed digits."""
    if fps is None:
        return None
    return float(round(fps)) if abs(fps - round(fps)) < ROUNDING * fps else float(fps)


def printed_rate(printed: str) -> tuple[float, tuple[Reason, ...]]:
    """The rate [Hz] of a printed frame time, with a note if its digits are ambiguous.

    Printed 0.017 or 0.0083 mean 60 or 120 Hz: if the frame time of exactly one standard rate rounds to the printed
    digits, that rate is returned. If several do (0.02 is 50 and 60 Hz) or none does, the quotient is returned.
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
    """Frames per second [Hz]; a stated rate overrides the declared one.

    `fault`: the error in the file's rate, raised if no rate is stated. Raises AmbiguousFileError if there is no rate,
    FileError for an invalid one.
    """
    if declared is None and statement.fps is None and fault is not None:
        raise fault
    fps = declared_rate(statement.fps if statement.fps is not None else declared)
    if fps is None:
        raise AmbiguousFileError(path, "the file does not say its frame rate.", STATE_RATE)
    if not 1.0 <= fps <= 10_000.0:
        raise FileError(path, f"the frame rate is {fps:g} Hz, expected 1 to 10000.", STATE_RATE)
    return fps


MIN_CORRELATION = 0.98
"""Least correlation between position differences and stored velocities for inferring a rate."""

FEWEST_FRAMES, MOST_FRAMES = 10, 20_000
"""Least and largest number of frames that are compared, from the first."""

CONTRADICTED = 0.05
"""Relative deviation from the inferred rate above which a declared rate is wrong, if `TIMES_MISFIT` is exceeded,
too."""

TIMES_MISFIT = 2.5
"""Deviation in multiples of the inferred rate's misfit above which a declared rate is wrong: smoothed or noisy
velocities give a rate that deviates by up to 2.3 times its misfit."""


@dataclass(frozen=True, kw_only=True)
class VelocityRate:
    """The rate of a motion according to its own velocities."""

    fps: float
    """[Hz]"""
    misfit: float
    """RMS residual between position differences at this rate and velocities, relative to the velocities' RMS."""

    @property
    def usual_fps(self) -> float | None:
        """The standard rate within 2 % [Hz]; None if there is none."""
        usual = min(STANDARD_HZ, key=lambda rate: abs(rate - self.fps))
        return float(usual) if abs(usual - self.fps) < 0.02 * usual else None

    def contradicts(self, declared: float) -> bool:
        """Whether a declared rate [Hz] contradicts these velocities."""
        off = abs(declared / self.fps - 1.0)
        return off > max(CONTRADICTED, TIMES_MISFIT * self.misfit)


def rate_of_velocities(position: np.ndarray, velocity: np.ndarray) -> VelocityRate | None:
    """The rate at which central differences of positions (t, ...) equal the velocities; None if they do not agree.

    Least squares over all columns of at most `MOST_FRAMES` frames. Frames with missing numbers are left out.
    """
    if len(position) < FEWEST_FRAMES or position.shape != velocity.shape:
        return None
    count = min(len(position), MOST_FRAMES)
    position, velocity = (finite_rows(each, 0, count).reshape(count, -1) for each in (position, velocity))
    step, stored = 0.5 * (position[2:] - position[:-2]), velocity[1:-1]
    known = np.isfinite(step).all(axis=1) & np.isfinite(stored).all(axis=1)
    step, stored = step[known], stored[known]
    power, other = float(np.sum(step * step)), float(np.sum(stored * stored))
    if len(step) < FEWEST_FRAMES - 2 or not power > 0.0 or not other > 0.0:
        return None
    product = float(np.sum(step * stored))
    correlation = product / float(np.sqrt(power * other))
    if correlation <= MIN_CORRELATION:
        return None
    return VelocityRate(fps=product / power, misfit=float(np.sqrt(max(0.0, 1.0 - correlation**2))))


def surest(*rates: VelocityRate | None) -> VelocityRate | None:
    """The rate with the smallest misfit; None without rates."""
    return min((rate for rate in rates if rate is not None), key=lambda rate: rate.misfit, default=None)


def checked_rate(
    path: Path, declared: float | None, by_velocity: VelocityRate | None, statement: Statement
) -> tuple[float | None, tuple[Reason, ...]]:
    """The file's rate [Hz], corrected by its velocities, and a reason if they contradict the declared rate.

    A missing or wrong declared rate is replaced by the rate from the velocities if that is a standard one. If the
    velocities contradict the declared rate with a non-standard rate, the clip is rejected until a rate is stated.
    """
    if by_velocity is None:
        return declared, ()
    usual = by_velocity.usual_fps
    if declared is None:
        if usual is None:
            return None, ()
        text = f"{path.name} does not say its frame rate; its positions and velocities agree at {usual:g} Hz"
        return usual, (Reason(code="derived_rate", text=text, effect="noted", value=usual, unit="Hz"),)
    stated = declared_rate(declared) or declared
    if not by_velocity.contradicts(stated):
        return declared, ()
    fps = usual or by_velocity.fps
    if statement.fps is not None:
        then, effect = f"{statement.fps:g} Hz is stated and stays", "noted"
    elif usual is not None:
        then, effect = f"{usual:g} Hz is taken", "repaired"
    else:
        then, effect = "which is no usual rate. State the right one as `fps:` in data/sources.yaml", "rejected"
    text = f"the file states {stated:g} Hz, but its own velocities are those of {fps:.4g} Hz: {then}"
    value, limit = round(fps / stated, 3), 1.0 + CONTRADICTED
    reason = Reason(code="time_base", text=text, effect=effect, value=value, limit=limit)
    return declared if effect == "rejected" else fps, (reason,)
