"""Bars of limit cycles, from the reference policy in MuJoCo and DART."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.validation.bars import CellBars, Required, ValidationSettings, bar_of
from pipeline.validation.limit_cycle_walks import ENGINES, SpeedCycles, figures_of, name_of


def limit_cycle_bars(runs: Sequence[Sequence[SpeedCycles]], rules: ValidationSettings) -> dict[str, CellBars]:
    """Bars of each speed from several runs: the worst of both legs and all planes plus the margin."""
    return {name_of(same[0].speed_m_s): _speed_bars(same, rules) for same in zip(*runs, strict=True)}


def _speed_bars(same: Sequence[SpeedCycles], rules: ValidationSettings) -> CellBars:
    compared = [figures_of(each) for found in same for each in found.comparisons if each.name.startswith(ENGINES[1])]
    names = compared[0] if compared else {}
    worst = {name: max(value for each in compared for value in each[name].values()) for name in names}
    reasons = [f"the reference: {text}" for found in same for text in found.missing if text.startswith(ENGINES)]
    reasons += _parted(worst, rules.required)
    legs = f"{len(compared)} legs"
    bars = {name: bar_of(name, value, legs, rules.margins) for name, value in worst.items()}
    return CellBars(required=not reasons, why="; ".join(reasons), bars=bars)


def _parted(worst: dict[str, float], required: Required) -> list[str]:
    apart = worst.get("period_difference", 0.0)
    if apart <= required.period_difference:
        return []
    return [f"the reference's period differs by {100.0 * apart:.0f} % between {' and '.join(ENGINES)}"]
