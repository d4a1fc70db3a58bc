"""The rate of a motion against the velocities that its own file stores."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.clips.outcome import Reason
from pipeline.files.array_file import finite_rows
from pipeline.readers.frame_rate import declared_rate
from pipeline.readers.statement import Statement

RATES_HZ = (24, 25, 30, 50, 60, 90, 100, 120, 125, 200, 240, 250, 300, 400, 500, 600, 1000, 2000)
"""Rates that one told by velocities is taken for when it is within 2 %."""

MIN_CORRELATION = 0.98
"""Of differences of position with the stored velocity; below it they tell no rate."""

FEWEST_FRAMES, MOST_FRAMES = 10, 20_000
"""Frames that are needed, and that are compared, from the first."""

CONTRADICTED = 0.05
"""A declared rate that is off by more than this share of the one that the velocities tell is wrong."""


def rate_of_velocities(position: np.ndarray, velocity: np.ndarray) -> float | None:
    """Rate [Hz] at which central differences of positions are the stored velocities; None where they do not agree.

    Least squares over all columns of at most `MOST_FRAMES` frames, taken for the usual rate within 2 %. Frames with
    missing numbers are left out.

    Args:
        position: (t, ...) of any number type
        velocity: of the same shape
    """
    if len(position) < FEWEST_FRAMES or position.shape != velocity.shape:
        return None
    position, velocity = (finite_rows(each, 0, MOST_FRAMES).reshape(-1, _width(each)) for each in (position, velocity))
    step, stored = 0.5 * (position[2:] - position[:-2]), velocity[1:-1]
    known = np.isfinite(step).all(axis=1) & np.isfinite(stored).all(axis=1)
    step, stored = step[known], stored[known]
    power, other = float(np.sum(step * step)), float(np.sum(stored * stored))
    if len(step) < FEWEST_FRAMES - 2 or not power > 0.0 or not other > 0.0:
        return None
    product = float(np.sum(step * stored))
    if product / np.sqrt(power * other) <= MIN_CORRELATION:
        return None
    fps = product / power
    usual = min(RATES_HZ, key=lambda rate: abs(rate - fps))
    return float(usual) if abs(usual - fps) < 0.02 * usual else None


def _width(array: np.ndarray) -> int:
    return int(np.prod(array.shape[1:]))


def checked_rate(
    path: Path, declared: float | None, by_velocity: float | None, statement: Statement
) -> tuple[float | None, tuple[Reason, ...]]:
    """The rate [Hz] to take for a file's own, and a reason where its velocities contradict what it declares.

    Args:
        declared: as the file says, None where it does not
        by_velocity: as its velocities tell, None where they do not
    """
    if by_velocity is None:
        return declared, ()
    if declared is None:
        text = f"{path.name} does not say its frame rate; its positions and velocities are {by_velocity:g} Hz apart"
        return by_velocity, (Reason(code="derived_rate", text=text, effect="noted", value=by_velocity, unit="Hz"),)
    said = declared_rate(declared) or declared
    if abs(said - by_velocity) <= CONTRADICTED * by_velocity:
        return declared, ()
    stays = statement.fps is not None
    then = f"{statement.fps:g} Hz is stated and stays" if stays else f"{by_velocity:g} Hz is taken"
    text = f"the file says {said:g} Hz, but its own velocities are those of {by_velocity:g} Hz: {then}"
    reason = Reason(
        code="time_base",
        text=text,
        effect="noted" if stays else "repaired",
        value=round(by_velocity / said, 3),
        limit=1.0 + CONTRADICTED,
    )
    return by_velocity, (reason,)
