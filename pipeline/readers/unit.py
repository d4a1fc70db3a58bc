"""The unit of length of a skeleton: the one that makes its legs human."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import AmbiguousFileError, FileError

METRES: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "cmu": 0.0254 / 0.45}
"""Metres per unit. `cmu` is the unit of the CMU recordings, 1/0.45 inch (their ASF files: `length 0.45`)."""

LEG_MIN, LEG_MAX = 0.60, 1.10
"""Hip to ankle, thigh plus shank [m]. .245 + .246 of the stature (Drillis and Contini 1966, in Winter 2009,
fig. 4.1) for 1.22 to 2.24 m. The limits are a factor of 1.83 apart, less than any two of the units, so at most one
unit fits."""

STATED_LEG_MIN, STATED_LEG_MAX = 0.4, 1.4
"""What a stated unit may give at most; beyond it the statement is wrong."""


def find_unit(path: Path, leg: float, stated: str | None) -> tuple[str, float]:
    """Name of the unit and metres per unit, of a skeleton whose leg is `leg` units long.

    `stated` is a unit's name or metres per unit. Raises AmbiguousFileError when no unit makes the leg human, FileError
    when the stated one does not.
    """
    if stated is not None:
        metres = stated_metres(path, stated)
        if not STATED_LEG_MIN <= leg * metres <= STATED_LEG_MAX:
            problem = f"with the stated unit '{stated}' a leg is {leg * metres:.3g} m long, a human's is about 0.8 m."
            raise FileError(path, problem, "Correct `unit:` in data/sources.yaml.")
        return stated, metres
    fitting = [name for name, metres in METRES.items() if LEG_MIN <= leg * metres <= LEG_MAX]
    if len(fitting) != 1:
        tried = ", ".join(f"{leg * metres:.3g} m in {name}" for name, metres in METRES.items())
        problem = f"the unit of length can't be inferred: a leg (hip to ankle) is {leg:.4g} units, which is {tried}."
        raise AmbiguousFileError(path, problem, _do(METRES))
    return fitting[0], METRES[fitting[0]]


def stated_metres(path: Path, stated: str) -> float:
    """Metres per stated unit: a name or a positive number. Raises FileError."""
    if stated in METRES:
        return METRES[stated]
    try:
        metres = float(stated)
    except ValueError:
        metres = 0.0
    if not 1e-6 < metres < 1e3:
        raise FileError(path, f"'{stated}' is not a unit.", _do(METRES))
    return metres


def _do(units: dict[str, float]) -> str:
    return f"State `unit:` for it in data/sources.yaml, one of {', '.join(units)} or metres per unit."
