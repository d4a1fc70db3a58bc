"""Bars of walks in several engines, limit cycles and Webots, derived from the reference policy's walks."""

from collections.abc import Mapping, Sequence

from pipeline.validation.bars import Agreement, Bar, CellBars, ValidationRules, bar_of, command_errors, missed
from pipeline.validation.cross_engine import HELD, NAMES, CellResult, CrossEngineResult, differences, errors_of
from pipeline.validation.cross_engine_walk import Cell, CrossEngineSettings
from pipeline.validation.limit_cycle_walks import ENGINES as CYCLE_ENGINES
from pipeline.validation.limit_cycle_walks import SpeedCycles
from pipeline.validation.limit_cycle_walks import figures_of as cycle_figures_of
from pipeline.validation.limit_cycle_walks import name_of as speed_name
from pipeline.webots.result import Allowed, WalkedSegment, WalkResult, WalkSegment, WebotsSettings


def engine_bars(
    runs: Sequence[CrossEngineResult], grid: CrossEngineSettings, rules: ValidationRules
) -> dict[str, CellBars]:
    """Bars of each cell from several runs of the grid: the worst walk in MuJoCo and DART plus the margin."""
    cells = zip(*(run.cells for run in runs), strict=True)
    return {same[0].name: _engine_cell_bars(same, grid.cells[same[0].name], rules) for same in cells}


def _engine_cell_bars(same: Sequence[CellResult], cell: Cell, rules: ValidationRules) -> CellBars:
    walks = [one for found in same for engine in HELD for one in found.figures[engine]]
    walked = f"{len(walks)} walks in {' and '.join(NAMES[engine] for engine in HELD)}"
    errors = [errors_of(cell, one) for one in walks if not one.fell]
    worst = {name: max(each[name] for each in errors) for name in errors[0]} if errors else {}
    falls = max(sum(one.fell for one in found.figures[engine]) for found in same for engine in HELD)
    bars: dict[str, Bar] = {"falls": bar_of("falls", float(falls), walked, rules.margins)}
    bars |= {name: bar_of(name, value, walked, rules.margins) for name, value in worst.items()}
    reasons = [reason for found in same for reason in _engine_failures(found, rules.agreement)]
    reasons += missed(worst, cell.command, rules.required)
    return CellBars(required=not reasons, why="; ".join(dict.fromkeys(reasons)), bars=bars)


def _engine_failures(found: CellResult, agreement: Agreement) -> list[str]:
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


def limit_cycle_bars(runs: Sequence[Sequence[SpeedCycles]], rules: ValidationRules) -> dict[str, CellBars]:
    """Bars of each speed from several runs: the worst of both legs and all planes plus the margin."""
    return {speed_name(same[0].speed_m_s): _speed_bars(same, rules) for same in zip(*runs, strict=True)}


def _speed_bars(same: Sequence[SpeedCycles], rules: ValidationRules) -> CellBars:
    compared = [
        cycle_figures_of(each) for found in same for each in found.comparisons if each.name.startswith(CYCLE_ENGINES[1])
    ]
    names = compared[0] if compared else {}
    worst = {name: max(value for each in compared for value in each[name].values()) for name in names}
    reasons = [f"the reference: {text}" for found in same for text in found.missing if text.startswith(CYCLE_ENGINES)]
    apart = worst.get("period_difference", 0.0)
    if apart > rules.required.period_difference:
        engines = " and ".join(CYCLE_ENGINES)
        reasons.append(f"the reference's period differs by {100.0 * apart:.0f} % between {engines}")
    legs = f"{len(compared)} legs"
    bars = {name: bar_of(name, value, legs, rules.margins) for name, value in worst.items()}
    return CellBars(required=not reasons, why="; ".join(reasons), bars=bars)


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
    walks: Mapping[str, WalkResult], settings: WebotsSettings, rules: ValidationRules
) -> dict[str, CellBars]:
    """Bars of each segment from one walk per engine, `walks` by the engine's name."""
    return {
        segment.name: _segment_bars(segment, {engine: walk.segments[place] for engine, walk in walks.items()}, rules)
        for place, segment in enumerate(settings.segments)
    }


def _segment_bars(segment: WalkSegment, rows: Mapping[str, WalkedSegment], rules: ValidationRules) -> CellBars:
    reasons = [f"the reference falls in {engine}" for engine, row in rows.items() if not row.walked]
    errors = [command_errors(segment.command, row.velocity) for row in rows.values() if row.walked]
    worst = {name: max(each[name] for each in errors) for name in errors[0]} if errors else {}
    reasons += missed(worst, segment.command, rules.required)
    trials = f"its walks in {'; '.join(rows)}"
    bars = {name: bar_of(name, value, trials, rules.margins) for name, value in worst.items()}
    return CellBars(required=not reasons, why="; ".join(reasons), bars=bars)


def _at_most(cell: CellBars, figure: str) -> float:
    """The bar of a figure; 0 if a required segment has none, which no walk meets."""
    bar = cell.bars.get(figure)
    return bar.at_most if bar is not None and bar.at_most is not None else 0.0
