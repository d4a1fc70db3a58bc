"""What is missing on the plane of forward speed and yaw rate, in words: turns while walking."""

from __future__ import annotations

import itertools

import pandas as pd

from pipeline.feasibility.balance_settings import BalanceSettings

DIRECTIONS = {"left": 1.0, "right": -1.0}


def missing_turns(cells: pd.DataFrame, settings: BalanceSettings) -> tuple[str, ...]:
    """A sentence for each direction of turning and stretch of speeds, forward or back, with the same turns missing.

    Speeds at which nothing at all is done are left out: the axis of forward speed says so.
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
            sentences += [_sentence(side, slow, fast, rates) for slow, fast in stretches if rates]
    return tuple(sentences)


def _missing_rates(line: pd.DataFrame, sign: float) -> tuple[tuple[float, float], ...]:
    """Stretches of yaw rate [rad/s], without sign, that have too little at one forward speed; inf for no end."""
    half = line[sign * (line["low_2"] + line["high_2"]) > 0.0]
    edges = sorted(
        (min(abs(low), abs(high)), max(abs(low), abs(high)))
        for low, high, there in zip(half["low_2"], half["high_2"], half["there"], strict=True)
        if not there
    )
    largest = float(half[["low_2", "high_2"]].abs().to_numpy().max())
    return tuple((low, float("inf") if high > largest - 1e-9 else high) for low, high in _joined(edges))


def _joined(stretches: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Stretches that touch as one."""
    joined: list[tuple[float, float]] = []
    for low, high in stretches:
        if joined and low < joined[-1][1] + 1e-9:
            joined[-1] = (joined[-1][0], high)
        else:
            joined.append((low, high))
    return joined


def _sentence(side: str, slow: float, fast: float, rates: tuple[tuple[float, float], ...]) -> str:
    said = [
        f"faster than {low:.3g} rad/s" if high == float("inf") else f"at {low:.3g} to {high:.3g} rad/s"
        for low, high in rates
    ]
    ahead = f"forward at {slow:.3g} to {fast:.3g}" if fast > 1e-9 else f"back at {abs(fast):.3g} to {-slow:.3g}"
    return f"No clip that goes {ahead} m/s turns {side} {' or '.join(said)}."
