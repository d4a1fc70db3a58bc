"""Bars of the walk in Webots, from the reference policy's walks in the stand-ins."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pipeline.validation.bars import CellBars, ValidationSettings, bar_of, missed
from pipeline.webots.result import WalkedSegment, WalkResult
from pipeline.webots.settings import Allowed, WalkSegment, WebotsSettings


def allowed_of(bars: Mapping[str, CellBars]) -> dict[str, Allowed]:
    """Thresholds of the required segments for `pipeline.webots.validate`."""
    return {
        name: Allowed(
            velocity_error_m_s=_at_most(cell, "speed_error"), yaw_rate_error_rad_s=_at_most(cell, "yaw_rate_error")
        )
        for name, cell in bars.items()
        if cell.required
    }


def webots_bars(
    walks: Mapping[str, WalkResult], settings: WebotsSettings, rules: ValidationSettings
) -> dict[str, CellBars]:
    """Bars of each segment from one walk per engine, `walks` by the engine's name."""
    found = {}
    for place, segment in enumerate(settings.segments):
        rows = {engine: result.segments[place] for engine, result in walks.items()}
        found[segment.name] = _segment_bars(segment, rows, rules)
    return found


def _segment_bars(segment: WalkSegment, rows: Mapping[str, WalkedSegment], rules: ValidationSettings) -> CellBars:
    reasons = [f"the reference falls in {engine}" for engine, row in rows.items() if not row.walked]
    errors = [_errors(segment, row) for row in rows.values() if row.walked]
    worst = {name: max(each[name] for each in errors) for name in errors[0]} if errors else {}
    forward, lateral, yaw_rate = segment.command
    sizes = {"speed_error": math.hypot(forward, lateral), "yaw_rate_error": abs(yaw_rate)}
    reasons += missed(worst, sizes, rules.required)
    trials = f"its walks in {'; '.join(rows)}"
    bars = {name: bar_of(name, value, trials, rules.margins) for name, value in worst.items()}
    return CellBars(required=not reasons, why="; ".join(reasons), bars=bars)


def _errors(segment: WalkSegment, row: WalkedSegment) -> dict[str, float]:
    forward, lateral, yaw_rate = (float(each or 0.0) for each in (row.forward_m_s, row.lateral_m_s, row.yaw_rate_rad_s))
    return {
        "speed_error": math.hypot(forward - segment.command[0], lateral - segment.command[1]),
        "yaw_rate_error": abs(yaw_rate - segment.command[2]),
    }


def _at_most(cell: CellBars, figure: str) -> float:
    """The bar of a figure; 0 if a required segment has none, which no walk meets."""
    bar = cell.bars.get(figure)
    return bar.at_most if bar is not None and bar.at_most is not None else 0.0
