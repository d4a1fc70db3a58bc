"""A verdict as text."""

from __future__ import annotations

from pipeline.validation.figures import FIGURES
from pipeline.validation.verdict import CellVerdict, Verdict


def as_text(verdict: Verdict, limit: int = 60) -> str:
    """Counts, the first `limit` reasons, cells that are not required, the note, and the verdict."""
    required = [cell for cell in verdict.cells if cell.bars.required]
    trials = sum(len(cell.measured.trials) for cell in verdict.cells)
    lines = [f"{len(verdict.cells)} cells, {len(required)} required, {trials} trials"]
    lines += [f"  failed  {reason}" for reason in verdict.reasons[:limit]]
    if len(verdict.reasons) > limit:
        lines.append(f"  and {len(verdict.reasons) - limit} reasons more")
    spared = [cell for cell in verdict.cells if not cell.bars.required]
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
