"""Seconds of motion in each part of the command space, and sentences on the missing parts."""

import itertools
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.feasibility.balance import BalanceSettings, effective_seconds_of, parents, takes
from pipeline.feasibility.command_space import (
    BOX,
    SECONDS_COLUMN,
    STANDING,
    VELOCITIES,
    Axis,
    CommandSettings,
    by_command,
    standing,
)
from pipeline.feasibility.gait_signature import COLUMN as SIGNATURE
from pipeline.feasibility.gait_signature import families
from pipeline.time_series import runs

NEEDED = ("clip", "seconds", *VELOCITIES)
"""Required columns."""

WHERE_THERE = (SECONDS_COLUMN, "weight", "parent", SIGNATURE)
"""Optional columns."""

AXES = ("forward", "lateral", "yaw")


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Seconds on the axes of the command space and on its plane of forward speed and yaw rate."""

    cells: pd.DataFrame
    """One row per cell: `axis` (`standing, forward, lateral, yaw, forward_yaw`), `low` and `high` of the first
    quantity, `low_2` and `high_2` of the second (plane alone), `seconds`, `clips` that visit it, number
    of `families` of distinct motion, and `effective_seconds_before`: effective seconds with equal weights. If the rows
    have weights, also `weight` and `effective_seconds`: effective seconds with these weights."""
    missing: tuple[str, ...]
    """Sentences: for each interval of an axis with too few seconds that is at least a cell wide or at the end of the
    range, then for each such interval of the plane."""


def coverage(rows: pd.DataFrame, settings: BalanceSettings, commands: CommandSettings) -> Coverage:
    """Coverage of the command ranges by the seconds that clips spend at each velocity.

    An axis counts the seconds whose other velocities are within one cell's width of 0. Seconds outside the ranges are
    not counted.
    """
    if rows.empty:
        rows = pd.DataFrame({name: pd.Series(dtype=float) for name in NEEDED})
    # No other column: a clip has a row in the table by command for each box it visits, some of them long texts.
    rows = pd.DataFrame(rows, columns=[name for name in (*NEEDED, *WHERE_THERE) if name in rows])
    spent = by_command(rows)
    of_clip = spent.pop("row").to_numpy(dtype=int)
    spent = spent[[name for name in ("seconds", "clip_seconds", "weight", *VELOCITIES) if name in spent]]
    family = families(rows, parents(rows), settings.same_gait) if len(rows) else rows["clip"]
    numbers = {"clip": np.arange(len(rows)), "family": pd.factorize(family)[0], "take": takes(rows)}
    spent = spent.assign(**{name: values[of_clip] for name, values in numbers.items()})
    if "weight" in spent:
        spent = spent.assign(weight=spent["weight"] * spent["seconds"] / spent["clip_seconds"])
    still = standing(spent, commands)
    tables = [_row(STANDING, 0.0, 0.0, _only(spent, still))]
    for axis in AXES:
        tables += _axis_rows(axis, _only(spent, _on_axis(spent, axis, commands) & ~still), _limits(axis, commands))
    tables += _plane_rows(_only(spent, _near(spent, "lateral", commands) & ~still), commands)
    cells = pd.DataFrame(tables)
    missing = (*_missing(spent, settings, commands), *_missing_turns(cells, settings))
    return Coverage(cells=cells, missing=missing)


def _limits(axis: str, commands: CommandSettings) -> Axis:
    return {"forward": commands.forward, "lateral": commands.lateral, "yaw": commands.yaw_rate}[axis]


def _velocity(rows: pd.DataFrame, axis: str) -> np.ndarray:
    return rows[VELOCITIES[AXES.index(axis)]].to_numpy(dtype=float)


def _near(rows: pd.DataFrame, axis: str, commands: CommandSettings) -> np.ndarray:
    """Mask (n,) of rows within a cell's width of 0 on an axis."""
    return np.abs(_velocity(rows, axis)) <= _limits(axis, commands)[2]


def _on_axis(rows: pd.DataFrame, axis: str, commands: CommandSettings) -> np.ndarray:
    """Mask (n,) of rows whose other two velocities are near 0."""
    return np.all([_near(rows, other, commands) for other in AXES if other != axis], axis=0)


def _only(rows: pd.DataFrame, mask: np.ndarray) -> pd.DataFrame:
    """Rows where `mask` (n,) is true."""
    return rows.loc[np.asarray(mask, dtype=bool)]


def _edges(limits: Axis) -> np.ndarray:
    low, high, width = limits
    return low + width * np.arange(round((high - low) / width) + 1)


def _axis_rows(axis: str, rows: pd.DataFrame, limits: Axis, name: str = "") -> list[dict]:
    """A row for each cell [low, high) of an axis."""
    edges = _edges(limits)
    index = np.searchsorted(edges, _velocity(rows, axis) + 1e-9, side="right") - 1
    pairs = enumerate(itertools.pairwise(edges))
    return [_row(name or axis, low, high, _only(rows, index == cell)) for cell, (low, high) in pairs]


def _plane_rows(rows: pd.DataFrame, commands: CommandSettings) -> list[dict]:
    edges = _edges(commands.yaw_rate)
    index = np.searchsorted(edges, _velocity(rows, "yaw") + 1e-9, side="right") - 1
    found = []
    for cell in range(len(edges) - 1):
        limits = {"low_2": float(edges[cell]), "high_2": float(edges[cell + 1])}
        line = _axis_rows("forward", _only(rows, index == cell), commands.forward, "forward_yaw")
        found += [{**entry, **limits} for entry in line]
    return found


def _row(axis: str, low: float, high: float, rows: pd.DataFrame) -> dict:
    clip, family, take = (rows[name].to_numpy() for name in ("clip", "family", "take"))
    seconds = rows["seconds"].to_numpy(dtype=float)
    entry = {
        "axis": axis,
        "low": float(np.round(low, 9)),
        "high": float(np.round(high, 9)),
        "low_2": np.nan,
        "high_2": np.nan,
        "seconds": float(np.sum(seconds)),
        "clips": len(np.unique(clip)),
        "families": len(np.unique(family)),
        "effective_seconds_before": effective_seconds_of(family, take, seconds, seconds),
    }
    if "weight" in rows:
        weight = rows["weight"].to_numpy(dtype=float)
        entry["weight"] = float(np.sum(weight))
        entry["effective_seconds"] = effective_seconds_of(family, take, seconds, weight)
    return entry


_WORDS = {
    "forward": ("walks forward", "walks back", "m/s"),
    "lateral": ("walks left", "walks right", "m/s"),
    "yaw": ("turns left", "turns right", "rad/s"),
}
"""Axis -> words for a positive and a negative velocity, and its unit."""


def _missing(spent: pd.DataFrame, settings: BalanceSettings, commands: CommandSettings) -> tuple[str, ...]:
    """Sentences for all directions. Standing also covers the boxes next to 0."""
    still_s = float(spent.loc[standing(spent, commands), "seconds"].sum())
    sentences = [f"No clip stands for {settings.missing_seconds:g} s."] if still_s < settings.missing_seconds else []
    for column, axis in enumerate(AXES):
        limits, width = _limits(axis, commands), float(BOX[column])
        rows = _only(spent, _on_axis(spent, axis, commands))
        along = _velocity(rows, axis)
        for sign, range_end, word in zip((1.0, -1.0), (limits[1], -limits[0]), _WORDS[axis], strict=False):
            seconds = np.histogram(
                sign * along + 1e-9, np.arange(round(range_end / width) + 1) * width, weights=rows["seconds"]
            )[0]
            seconds[0] += still_s
            there = _there(seconds, round(limits[2] / width), settings.missing_seconds)
            gaps = [(low * width, high * width) for low, high in runs(~there)]
            wide = [gap for gap in gaps if gap[1] - gap[0] > limits[2] - 1e-9 or gap[1] > range_end - 1e-9]
            sentences += [_sentence(word, low, high, range_end, _WORDS[axis][2]) for low, high in wide]
    return tuple(sentences)


def _there(seconds: np.ndarray, boxes: int, least: float) -> np.ndarray:
    """Mask (n,) of covered boxes from 0 outward: boxes with their part of a cell's least seconds, in a cell of `boxes`
    boxes that has all of them."""
    starts = np.arange(0, len(seconds), boxes)
    sizes = np.diff(np.append(starts, len(seconds)))
    cell = np.add.reduceat(seconds, starts) >= least * sizes / boxes - 1e-9
    return (seconds >= least / boxes - 1e-9) & np.repeat(cell, sizes)


def _sentence(word: str, low: float, high: float, range_end: float, unit: str) -> str:
    if high > range_end - 1e-9:
        return f"No clip {word} faster than {low:.3g} {unit}."
    return f"No clip {word} at {low:.3g} to {high:.3g} {unit}."


DIRECTIONS = {"left": 1.0, "right": -1.0}


def _missing_turns(cells: pd.DataFrame, settings: BalanceSettings) -> tuple[str, ...]:
    """Missing turns while walking: a sentence for each turning direction and each interval of forward or backward
    speeds with the same missing turns.

    Speeds without any data are left out, since the sentences on the forward axis report them.
    """
    plane = cells[cells["axis"] == "forward_yaw"]
    plane = plane.assign(there=plane["seconds"] >= settings.missing_seconds)
    by_speed = [line for _, line in plane.groupby("low") if line["there"].to_numpy(dtype=bool).any()]
    sentences = []
    for side, sign in DIRECTIONS.items():
        lines = [
            (float(line["low"].iloc[0]), float(line["high"].iloc[0]), _missing_rates(line, sign)) for line in by_speed
        ]
        for (_, rates), same in itertools.groupby(lines, key=lambda line: (line[1] > 1e-9, line[2])):
            stretches = _joined([(low, high) for low, high, _ in same])
            sentences += [_turns_sentence(side, slow, fast, rates) for slow, fast in stretches if rates]
    return tuple(sentences)


def _missing_rates(line: pd.DataFrame, sign: float) -> tuple[tuple[float, float], ...]:
    """Intervals of absolute yaw rate [rad/s] with too few seconds at one forward speed; inf for no upper end."""
    half = line[sign * (line["low_2"] + line["high_2"]) > 0.0]
    edges = sorted(
        (min(abs(low), abs(high)), max(abs(low), abs(high)))
        for low, high, there in zip(half["low_2"], half["high_2"], half["there"], strict=True)
        if not there
    )
    largest = float(half[["low_2", "high_2"]].abs().to_numpy().max())
    return tuple((low, float("inf") if high > largest - 1e-9 else high) for low, high in _joined(edges))


def _joined(stretches: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Merge adjacent intervals."""
    joined: list[tuple[float, float]] = []
    for low, high in stretches:
        if joined and low < joined[-1][1] + 1e-9:
            joined[-1] = (joined[-1][0], high)
        else:
            joined.append((low, high))
    return joined


def _turns_sentence(side: str, slow: float, fast: float, rates: tuple[tuple[float, float], ...]) -> str:
    rates_text = [
        f"faster than {low:.3g} rad/s" if high == float("inf") else f"at {low:.3g} to {high:.3g} rad/s"
        for low, high in rates
    ]
    direction = f"forward at {slow:.3g} to {fast:.3g}" if fast > 1e-9 else f"back at {abs(fast):.3g} to {-slow:.3g}"
    return f"No clip that goes {direction} m/s turns {side} {' or '.join(rates_text)}."
