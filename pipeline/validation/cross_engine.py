"""The same policy, gains and motors in MuJoCo, its bridge and DART: a matrix of cells and a verdict with every reason.

A cell is required where the published policy survives it; there the policy must not fall in MuJoCo nor in DART, must
keep to its command as far as the cell's bar says, and both engines must agree. What differs between MuJoCo and the
bridge is the armature on the links, what differs between the bridge and DART is contact and solver; a difference that
the bridge has to MuJoCo as well is the approximation's and no fault of the policy: it is listed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pipeline.batch import ClipPool
from pipeline.validation.cross_engine_settings import Cell, CrossEngineSettings
from pipeline.validation.cross_engine_walk import BRIDGE, DART, ENGINES, MUJOCO, Figures, walk_cell
from pipeline.validation.deployed import Deployed

NAMES = {"mujoco": "MuJoCo", "bridge": "MuJoCo with the armature on the links", "dart": "DART"}
HELD = (MUJOCO, DART)
"""Engines that the bars hold for; the bridge explains."""


@dataclass(frozen=True, kw_only=True)
class CellResult:
    """A cell in every engine, one entry a seed."""

    name: str
    required: bool
    figures: dict[str, tuple[Figures, ...]]
    """By engine."""
    reasons: tuple[str, ...]
    """Everything that is wrong with it, whether or not it is required."""
    explained: tuple[str, ...] = ()
    """Differences of MuJoCo and DART that the armature on the links makes: the bridge and DART agree."""

    def survival(self, engine: str) -> float:
        """Share of the seeds that did not fall."""
        return float(np.mean([not each.fell for each in self.figures[engine]]))

    def mean(self, engine: str, figure: str) -> float:
        """Of a figure over the seeds that did not fall; NaN where all did."""
        values = [getattr(each, figure) for each in self.figures[engine] if not each.fell]
        return float(np.mean(values)) if values else math.nan


@dataclass(frozen=True, kw_only=True)
class CrossEngineResult:
    """The matrix and what it says."""

    robot: str
    cells: tuple[CellResult, ...]

    @property
    def reasons(self) -> tuple[str, ...]:
        """Of the required cells."""
        return tuple(reason for cell in self.cells if cell.required for reason in cell.reasons)

    @property
    def passed(self) -> bool:
        """Whether no required cell has a reason; of no required cell nothing passes."""
        return not self.reasons and any(cell.required for cell in self.cells)

    @property
    def not_required(self) -> tuple[str, ...]:
        return tuple(cell.name for cell in self.cells if not cell.required)

    def rows(self) -> list[dict[str, Any]]:
        """One row a cell and engine: survival and means over the seeds."""
        figures = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "height_m", "power_w")
        return [
            {
                "cell": cell.name,
                "required": cell.required,
                "engine": engine,
                "survival": cell.survival(engine),
                **{name: _finite(cell.mean(engine, name)) for name in figures},
            }
            for cell in self.cells
            for engine in cell.figures
        ]

    def to_dict(self) -> dict[str, Any]:
        """JSON types: the verdict, every reason, every walk."""
        return {
            "robot": self.robot,
            "passed": self.passed,
            "reasons": list(self.reasons),
            "explained": [text for cell in self.cells if cell.required for text in cell.explained],
            "not_required": {cell.name: list(cell.reasons) for cell in self.cells if not cell.required},
            "rows": self.rows(),
            "walks": {
                cell.name: {
                    engine: [{key: _finite(value) for key, value in asdict(one).items()} for one in each]
                    for engine, each in cell.figures.items()
                }
                for cell in self.cells
            },
        }


def cross_engine(
    deployed: Deployed,
    settings: CrossEngineSettings,
    *,
    pool: ClipPool | None = None,
    engines: tuple[str, ...] = ENGINES,
    only: tuple[str, ...] = (),
) -> CrossEngineResult:
    """Walk the grid and judge it.

    Args:
        deployed: what is judged
        settings: cells, bars and tolerances
        pool: processes for the walks; this one where not given
        engines: those that walk; the bridge can be left out
        only: names of cells; all where empty
    """
    cells = {name: cell for name, cell in settings.cells.items() if not only or name in only}
    seeds = range(settings.simulation.seeds)
    jobs = [(name, engine, seed) for name in cells for engine in engines for seed in seeds]
    calls = [(deployed, engine, cells[name], seed, settings.simulation) for name, engine, seed in jobs]
    found = dict(zip(jobs, (pool or ClipPool(workers=1)).map(walk_cell, calls), strict=True))
    results = []
    for name, cell in cells.items():
        figures = {engine: tuple(found[name, engine, seed] for seed in seeds) for engine in engines}
        apart = _apart(name, cell, figures, settings)
        reasons = (*_wrong(name, cell, figures), *(text for text, explained in apart if not explained))
        known = tuple(text for text, explained in apart if explained)
        results.append(CellResult(name=name, required=cell.required, figures=figures, reasons=reasons, explained=known))
    return CrossEngineResult(robot=deployed.robot.name, cells=tuple(results))


def _wrong(name: str, cell: Cell, figures: dict[str, tuple[Figures, ...]]) -> Iterator[str]:
    """Falls and commands that are not kept."""
    for engine in (engine for engine in HELD if engine in figures):
        for seed, one in enumerate(figures[engine]):
            where = f"cell '{name}' seed {seed} in {NAMES[engine]}"
            if one.fell:
                yield f"{where}: fell after {one.fell_s:.2f} s"
            else:
                yield from (f"{where}: {problem}" for problem in _off_command(cell, one))


def _off_command(cell: Cell, figures: Figures) -> Iterator[str]:
    forward, lateral, yaw_rate = cell.segments[-1].command
    error = math.hypot(figures.forward_m_s - forward, figures.lateral_m_s - lateral)
    if cell.velocity_error_m_s is not None and error > cell.velocity_error_m_s:
        got = f"{figures.forward_m_s:.2f}, {figures.lateral_m_s:.2f} m/s for {forward:g}, {lateral:g}"
        yield f"walks {got}, off by {error:.3f}, allowed is {cell.velocity_error_m_s:g}"
    off = abs(figures.yaw_rate_rad_s - yaw_rate)
    if cell.yaw_rate_error_rad_s is not None and off > cell.yaw_rate_error_rad_s:
        got = f"{figures.yaw_rate_rad_s:.2f} rad/s for {yaw_rate:g}"
        yield f"turns {got}, off by {off:.3f}, allowed is {cell.yaw_rate_error_rad_s:g}"


def _apart(
    name: str, cell: Cell, figures: dict[str, tuple[Figures, ...]], settings: CrossEngineSettings
) -> list[tuple[str, bool]]:
    """Differences of MuJoCo and DART beyond the tolerance, of the means over the seeds that neither fell in, and
    whether the armature on the links explains them: then the bridge, which has it too, and DART agree. A bridge that
    fell in one of those seeds explains nothing."""
    if not cell.compared or any(engine not in figures for engine in HELD):
        return []
    held = zip(*(figures[engine] for engine in HELD), strict=True)
    both = [seed for seed, each in enumerate(held) if not any(one.fell for one in each)]
    if not both:
        return []
    stood = {engine: each for engine, each in figures.items() if not any(each[seed].fell for seed in both)}
    found = []
    for figure, (bar, what, unit) in _tolerances(figures, both, settings).items():
        mean = {engine: float(np.mean([getattr(each[s], figure) for s in both])) for engine, each in stood.items()}
        difference = mean[DART] - mean[MUJOCO]
        if abs(difference) > bar:
            text = (
                f"cell '{name}': {what} {mean[MUJOCO]:.3f} {unit} in MuJoCo and {mean[DART]:.3f} in DART, "
                f"{abs(difference):.3f} apart, allowed is {bar:.3f}{_attribution(mean)}"
            )
            found.append((text, BRIDGE in mean and abs(mean[DART] - mean[BRIDGE]) <= bar))
    return found


def _tolerances(
    figures: dict[str, tuple[Figures, ...]], seeds: list[int], settings: CrossEngineSettings
) -> dict[str, tuple[float, str, str]]:
    """Of each figure: how far engines may be apart, what it is, its unit."""
    agreement, ours = settings.agreement, figures[MUJOCO]
    speed = math.hypot(*(np.mean([getattr(ours[s], name) for s in seeds]) for name in ("forward_m_s", "lateral_m_s")))
    velocity = max(agreement.velocity_m_s, agreement.velocity_share * speed)
    return {
        "forward_m_s": (velocity, "forward velocity", "m/s"),
        "lateral_m_s": (velocity, "lateral velocity", "m/s"),
        "yaw_rate_rad_s": (agreement.yaw_rate_rad_s, "yaw rate", "rad/s"),
        "height_m": (agreement.height_m, "root height", "m"),
    }


def _attribution(mean: dict[str, float]) -> str:
    if BRIDGE not in mean:
        return ""
    model, contact = mean[BRIDGE] - mean[MUJOCO], mean[DART] - mean[BRIDGE]
    return f" ({model:+.3f} from the armature on the links, {contact:+.3f} from contact and solver)"


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
