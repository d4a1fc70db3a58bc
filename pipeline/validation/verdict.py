"""One verdict with every reason: measured cells compared with their bars."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pipeline.validation.bars import UNKNOWN, CellBars, ValidationSettings
from pipeline.validation.figures import FIGURES, Measured


@dataclass(frozen=True, kw_only=True)
class Reason:
    """A figure that misses its bar."""

    cell: str
    figure: str
    got: float
    bar: str

    def __str__(self) -> str:
        unit = FIGURES[self.figure].unit
        return f"{self.cell}: {self.figure.replace('_', ' ')} {self.got:.3g} {unit}, asked is {self.bar}"


@dataclass(frozen=True, kw_only=True)
class CellOutcome:
    """A cell's bars and the reasons why it fails."""

    bars: CellBars
    reasons: tuple[Any, ...]
    """Every figure that misses its bar, also in cells that are not required."""

    @property
    def required(self) -> bool:
        return self.bars.required

    @property
    def passed(self) -> bool:
        return not self.reasons or not self.required

    @property
    def word(self) -> str:
        """`passed`, `failed` or `not required`."""
        if not self.required:
            return "not required"
        return "failed" if self.reasons else "passed"


C = TypeVar("C", bound=CellOutcome)


@dataclass(frozen=True, kw_only=True)
class SuiteOutcome(Generic[C]):
    """The outcome of several cells."""

    cells: tuple[C, ...]
    robot_of_bars: str = ""
    """Digest of the robot that the bars were derived on."""
    note: str = ""
    """Note if the bars belong to another robot than the evaluated one; otherwise empty."""

    @property
    def passed(self) -> bool:
        """Whether every required cell meets all its bars; False without any required cell."""
        return not self.failed_cells and any(cell.required for cell in self.cells)

    @property
    def reasons(self) -> tuple[Any, ...]:
        """Reasons of all required cells."""
        return tuple(reason for cell in self.cells if cell.required for reason in cell.reasons)

    @property
    def failed_cells(self) -> tuple[C, ...]:
        """Required cells that fail."""
        return tuple(cell for cell in self.cells if not cell.passed)


@dataclass(frozen=True, kw_only=True)
class CellVerdict(CellOutcome):
    """Verdict on one cell; the reasons are `Reason`."""

    measured: Measured


@dataclass(frozen=True, kw_only=True)
class Verdict(SuiteOutcome[CellVerdict]):
    """Verdict on a policy and robot by a suite."""

    suite: str
    policy: str
    """Digest."""
    robot: str
    """Digest."""

    def to_dict(self) -> dict[str, Any]:
        """The verdict as JSON types."""
        return {
            "suite": self.suite,
            "policy": self.policy,
            "robot": self.robot,
            "robot_of_bars": self.robot_of_bars,
            "note": self.note or None,
            "passed": self.passed,
            "reasons": [str(reason) for reason in self.reasons],
            "not_required": {cell.measured.cell.name: cell.bars.why for cell in self.cells if not cell.required},
            "cells": [_cell(cell) for cell in self.cells],
        }


def judge(
    measured: Sequence[Measured], settings: ValidationSettings, *, suite: str, policy: str, robot: str
) -> Verdict:
    """Compare each cell with its bars. A cell that the file does not contain is not required, with that reason.

    Bars of another robot are also used; the verdict then has a note.
    """
    cells = []
    for one in measured:
        bars = settings.cells.get(one.cell.name, UNKNOWN)
        cells.append(CellVerdict(measured=one, bars=bars, reasons=tuple(_reasons(one, bars))))
    return Verdict(
        suite=suite,
        policy=policy,
        robot=robot,
        cells=tuple(cells),
        robot_of_bars=settings.reference.robot,
        note=settings.reference.note_on(robot),
    )


def _reasons(one: Measured, bars: CellBars) -> Iterator[Reason]:
    """Figures that miss their bars; a figure without a value, since every trial fell, misses none."""
    for name, bar in bars.bars.items():
        got = one.figure(name)
        if got is not None and not bar.holds(got):
            yield Reason(cell=one.cell.name, figure=name, got=got, bar=str(bar))


def _cell(cell: CellVerdict) -> dict[str, Any]:
    one = cell.measured
    shown = dict.fromkeys((*one.cell.figures, "forward", "lateral", "yaw_rate", "power", "slip", "saturation"))
    return {
        "cell": one.cell.name,
        "group": one.cell.group,
        "verdict": cell.word,
        "trials": len(one.trials),
        "fell": list(one.fallen),
        "figures": {name: one.figure(name) for name in one.cell.figures},
        "bars": {name: {"asked": str(bar), "source": bar.source} for name, bar in cell.bars.bars.items()},
        "spread": {name: one.spread(name) for name in shown if one.spread(name)},
        "reasons": [str(reason) for reason in cell.reasons],
    }


def as_text(verdict: Verdict, limit: int = 60) -> str:
    """Counts, the first `limit` reasons, cells that are not required, the note, and the verdict."""
    required = [cell for cell in verdict.cells if cell.required]
    trials = sum(len(cell.measured.trials) for cell in verdict.cells)
    lines = [f"{len(verdict.cells)} cells, {len(required)} required, {trials} trials"]
    lines += [f"  failed  {reason}" for reason in verdict.reasons[:limit]]
    if len(verdict.reasons) > limit:
        lines.append(f"  and {len(verdict.reasons) - limit} reasons more")
    spared = [cell for cell in verdict.cells if not cell.required]
    lines += [f"  not required  {cell.measured.cell.name}: {cell.bars.why}" for cell in spared]
    lines += [f"  note  {verdict.note}"] if verdict.note else []
    failed = f"{len(verdict.failed_cells)} of {len(required)} required cells failed"
    lines.append("passed" if verdict.passed else failed if required else "no cell is required: nothing was shown")
    return "\n".join(lines)


def table(verdict: Verdict) -> list[dict[str, str]]:
    """One row per cell: verdict, trials, falls, figures with their bars."""
    return [_row(cell) for cell in verdict.cells]


def _row(cell: CellVerdict) -> dict[str, str]:
    one = cell.measured
    figures = []
    for name in one.cell.figures:
        got, bar = one.figure(name), cell.bars.bars.get(name)
        value = "none" if got is None else f"{got:.3g} {FIGURES[name].unit}"
        figures.append(f"{name.replace('_', ' ')} {value}" + (f" ({bar})" if bar else ""))
    return {
        "cell": one.cell.name,
        "verdict": cell.word,
        "trials": str(len(one.trials)),
        "falls": str(len(one.fallen)),
        "figures": "; ".join(figures),
        "reasons": "; ".join(map(str, cell.reasons)) or cell.bars.why,
    }
