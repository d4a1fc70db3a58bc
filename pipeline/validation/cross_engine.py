"""The same policy, gains and motors in MuJoCo, its bridge and DART: a matrix of cells and a verdict with every reason.

A cell is required if the robot's `validation.yaml` states so, i.e. if the reference policy passes it. In a required
cell the policy must not fall in MuJoCo or DART, must follow its command within the cell's bars, and both engines must
agree. MuJoCo and the bridge differ in the armature on the links, the bridge and DART in contact and solver. A
difference that the bridge has to MuJoCo as well comes from the approximation; it is listed, not counted.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.batch import ClipPool
from pipeline.files import settings as settings_files
from pipeline.files.csv_json import without_nan
from pipeline.validation.bars import (
    UNKNOWN,
    Agreement,
    CellBars,
    Tolerance,
    ValidationSettings,
    command_errors,
    scaled_to,
)
from pipeline.validation.cross_engine_walk import (
    BRIDGE,
    DART,
    ENGINES,
    MUJOCO,
    Cell,
    CrossEngineSettings,
    Figures,
    walk_cell,
)
from pipeline.validation.deployed import Deployed
from pipeline.validation.verdict import CellOutcome, SuiteOutcome

NAMES = {"mujoco": "MuJoCo", "bridge": "MuJoCo with the armature on the links", "dart": "DART"}
HELD = (MUJOCO, DART)
"""Engines that must meet the bars; the bridge only explains differences."""
COMPARED = (
    ("forward_m_s", "velocity", "forward velocity"),
    ("lateral_m_s", "velocity", "lateral velocity"),
    ("yaw_rate_rad_s", "yaw_rate", "yaw rate"),
    ("height_m", "height", "root height"),
)
"""Figures in which both engines have to agree: field, entry of `agreement`, name."""


@dataclass(frozen=True, kw_only=True)
class CellResult(CellOutcome):
    """A cell in every engine, one entry per seed; the reasons are sentences."""

    name: str
    figures: dict[str, tuple[Figures, ...]]
    """By engine."""
    explained: tuple[str, ...] = ()
    """Differences of MuJoCo and DART that come from the armature on the links: bridge and DART agree."""

    def survival(self, engine: str) -> float:
        """Share of the seeds that did not fall."""
        return float(np.mean([not each.fell for each in self.figures[engine]]))

    def mean(self, engine: str, figure: str) -> float:
        """Mean of a figure over the seeds that did not fall; NaN if all fell."""
        values = [getattr(each, figure) for each in self.figures[engine] if not each.fell]
        return float(np.mean(values)) if values else math.nan


@dataclass(frozen=True, kw_only=True)
class CrossEngineResult(SuiteOutcome[CellResult]):
    """The matrix of cells and engines, with its verdict."""

    robot: str
    """Its name."""
    robot_digest: str = ""

    @property
    def not_required(self) -> dict[str, str]:
        """Cells that are not required, with the reason."""
        return {cell.name: cell.bars.why for cell in self.cells if not cell.required}

    def rows(self) -> list[dict[str, Any]]:
        """One row per cell and engine: survival, means over the seeds, and the bars."""
        figures = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "height_m", "power_w")
        return [
            {
                "cell": cell.name,
                "verdict": cell.word,
                "engine": engine,
                "survival": cell.survival(engine),
                **without_nan({name: cell.mean(engine, name) for name in figures}),
                "asked": "; ".join(f"{name.replace('_', ' ')} {bar}" for name, bar in cell.bars.bars.items()),
            }
            for cell in self.cells
            for engine in cell.figures
        ]

    def to_dict(self) -> dict[str, Any]:
        """JSON types: the verdict, every reason, every walk."""
        return {
            "robot": self.robot,
            "robot_digest": self.robot_digest,
            "robot_of_bars": self.robot_of_bars,
            "note": self.note or None,
            "passed": self.passed,
            "reasons": list(self.reasons),
            "explained": [text for cell in self.cells if cell.required for text in cell.explained],
            "not_required": {cell.name: [cell.bars.why, *cell.reasons] for cell in self.cells if not cell.required},
            "bars": {cell.name: settings_files.plain(cell.bars) for cell in self.cells},
            "rows": self.rows(),
            "walks": without_nan({cell.name: settings_files.plain(cell.figures) for cell in self.cells}),
        }


def cross_engine(
    deployed: Deployed,
    grid: CrossEngineSettings,
    bars: ValidationSettings,
    *,
    pool: ClipPool | None = None,
    engines: tuple[str, ...] = ENGINES,
    only: tuple[str, ...] = (),
) -> CrossEngineResult:
    """Run the grid and evaluate it.

    Args:
        deployed: the policy on its robot
        grid: cells and common simulation settings
        bars: bars of each cell, and tolerances between engines
        pool: processes for the rollouts; default: this process
        engines: engines to run; the bridge can be left out
        only: names of cells; empty: all
    """
    cells = {name: cell for name, cell in grid.cells.items() if not only or name in only}
    seeds = range(grid.simulation.seeds)
    jobs = [(name, engine, seed) for name in cells for engine in engines for seed in seeds]
    calls = [(deployed, engine, cells[name], seed, grid.simulation) for name, engine, seed in jobs]
    found = dict(zip(jobs, (pool or ClipPool(workers=1)).map(walk_cell, calls), strict=True))
    agreement = scaled_to(bars, deployed.robot).agreement
    results = []
    for name, cell in cells.items():
        figures = {engine: tuple(found[name, engine, seed] for seed in seeds) for engine in engines}
        asked = bars.engines.get(name, UNKNOWN)
        apart = differences(name, figures, agreement)
        reasons = (*_wrong(name, cell, asked, figures), *(text for text, explained in apart if not explained))
        known = tuple(text for text, explained in apart if explained)
        results.append(CellResult(name=name, bars=asked, figures=figures, reasons=reasons, explained=known))
    return CrossEngineResult(
        robot=deployed.robot.name,
        cells=tuple(results),
        robot_digest=deployed.robot.digest,
        robot_of_bars=bars.reference.robot,
        note=bars.reference.note_on(deployed.robot.digest),
    )


def errors_of(cell: Cell, figures: Figures) -> dict[str, float]:
    """Errors of a walk relative to the cell's last command: `speed_error` [m/s] and `yaw_rate_error` [rad/s]."""
    return command_errors(cell.command, figures.velocity)


def _wrong(name: str, cell: Cell, asked: CellBars, figures: dict[str, tuple[Figures, ...]]) -> Iterator[str]:
    """Falls beyond the bar, and commands that are not followed."""
    falls = asked.bars.get("falls")
    for engine in (engine for engine in HELD if engine in figures):
        count = sum(one.fell for one in figures[engine])
        too_many = count > 0 and (falls is None or not falls.holds(float(count)))
        for seed, one in enumerate(figures[engine]):
            where = f"cell '{name}' seed {seed} in {NAMES[engine]}"
            if one.fell and too_many:
                yield f"{where}: fell after {one.fell_s:.2f} s"
            elif not one.fell:
                yield from (f"{where}: {problem}" for problem in off_command(cell, asked, one))


def off_command(cell: Cell, asked: CellBars, figures: Figures) -> Iterator[str]:
    """Deviations from the command beyond the bars, for a walk without a fall."""
    forward, lateral, yaw_rate = cell.command
    texts = {
        "speed_error": f"walks {figures.forward_m_s:.2f}, {figures.lateral_m_s:.2f} m/s for {forward:g}, {lateral:g}",
        "yaw_rate_error": f"turns {figures.yaw_rate_rad_s:.2f} rad/s for {yaw_rate:g}",
    }
    for figure, error in errors_of(cell, figures).items():
        bar = asked.bars.get(figure)
        if bar is not None and not bar.holds(error):
            yield f"{texts[figure]}, off by {error:.3f}, asked is {bar}"


def differences(name: str, figures: dict[str, tuple[Figures, ...]], agreement: Agreement) -> list[tuple[str, bool]]:
    """Differences of MuJoCo and DART beyond the tolerance, each with whether the armature on the links explains it.

    Means are over the seeds without a fall in either engine. A difference is explained if bridge and DART agree; a
    bridge that fell in one of those seeds explains nothing.
    """
    if any(engine not in figures for engine in HELD):
        return []
    held = zip(*(figures[engine] for engine in HELD), strict=True)
    both = [seed for seed, each in enumerate(held) if not any(one.fell for one in each)]
    if not both:
        return []
    stood = {engine: each for engine, each in figures.items() if not any(each[seed].fell for seed in both)}
    means = {
        engine: {name: float(np.mean([getattr(each[seed], name) for seed in both])) for name, _, _ in COMPARED}
        for engine, each in stood.items()
    }
    speed = math.hypot(means[MUJOCO]["forward_m_s"], means[MUJOCO]["lateral_m_s"])
    found = []
    for figure, kind, what in COMPARED:
        tolerance: Tolerance = getattr(agreement, kind)
        bar, mean = tolerance.of(speed), {engine: each[figure] for engine, each in means.items()}
        difference = abs(mean[DART] - mean[MUJOCO])
        if difference > bar:
            engines = f"{mean[MUJOCO]:.3f} {tolerance.unit} in MuJoCo and {mean[DART]:.3f} in DART"
            text = f"cell '{name}': {what} {engines}, {difference:.3f} apart, allowed is {bar:.3f}"
            if BRIDGE in mean:
                model, contact = mean[BRIDGE] - mean[MUJOCO], mean[DART] - mean[BRIDGE]
                text += f" ({model:+.3f} from the armature on the links, {contact:+.3f} from contact and solver)"
            found.append((text, BRIDGE in mean and abs(mean[DART] - mean[BRIDGE]) <= bar))
    return found
