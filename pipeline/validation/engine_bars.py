"""Bars of the cross-engine grid, from the reference policy's walks."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.validation.bars import Agreement, Bar, CellBars, ValidationSettings, bar_of, missed
from pipeline.validation.cross_engine import HELD, NAMES, CellResult, CrossEngineResult, differences, errors_of
from pipeline.validation.cross_engine_settings import Cell, CrossEngineSettings


def engine_bars(
    runs: Sequence[CrossEngineResult], grid: CrossEngineSettings, rules: ValidationSettings
) -> dict[str, CellBars]:
    """Bars of each cell from several runs of the grid: the worst walk in MuJoCo and DART plus the margin."""
    cells = zip(*(run.cells for run in runs), strict=True)
    return {same[0].name: _cell_bars(same, grid.cells[same[0].name], rules) for same in cells}


def _cell_bars(same: Sequence[CellResult], cell: Cell, rules: ValidationSettings) -> CellBars:
    walks = [one for found in same for engine in HELD for one in found.figures[engine]]
    walked = f"{len(walks)} walks in {' and '.join(NAMES[engine] for engine in HELD)}"
    errors = [errors_of(cell, one) for one in walks if not one.fell]
    worst = {name: max(each[name] for each in errors) for name in errors[0]} if errors else {}
    falls = max(sum(one.fell for one in found.figures[engine]) for found in same for engine in HELD)
    bars: dict[str, Bar] = {"falls": bar_of("falls", float(falls), walked, rules.margins)}
    bars |= {name: bar_of(name, value, walked, rules.margins) for name, value in worst.items()}
    forward, lateral, yaw_rate = cell.segments[-1].command
    sizes = {"speed_error": math.hypot(forward, lateral), "yaw_rate_error": abs(yaw_rate)}
    reasons = [reason for found in same for reason in _failures(found, rules.agreement)]
    reasons += missed(worst, sizes, rules.required)
    return CellBars(required=not reasons, why="; ".join(dict.fromkeys(reasons)), bars=bars)


def _failures(found: CellResult, agreement: Agreement) -> list[str]:
    """Why the reference does not pass a cell: falls, and differences that the armature does not explain.

    Differences count for the mean over the seeds and for each single seed: agreement only on average is not enough.
    """
    reasons = []
    for engine in HELD:
        fallen = sum(one.fell for one in found.figures[engine])
        if fallen:
            reasons.append(f"the reference falls in {NAMES[engine]} in {fallen} of {len(found.figures[engine])}")
    seeds = range(len(found.figures[HELD[0]]))
    single = [{engine: (each[seed],) for engine, each in found.figures.items()} for seed in seeds]
    for figures in (found.figures, *single):
        parted = [text for text, explained in differences(found.name, figures, agreement) if not explained]
        if parted:
            return reasons + [text.partition(": ")[2] for text in parted]
    return reasons
