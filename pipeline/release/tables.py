"""Tables of the figures that a check measured, with the bars they were compared with."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.validation.figures import FIGURES

VERDICT = "verdict"
"""Column whose words are shown in the colour of their status."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of texts under a header, all of the header's length."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: frozenset[int] = frozenset()
    """Columns of numbers."""


def tables_of(result: Mapping[str, Any]) -> tuple[Table, ...]:
    """The tables of a stored result: cells of a suite, walks in several engines, limit cycles, segments of a run.

    A result that has none of them gives no table; a part that is not in its form is left out.
    """
    found = (
        _table("Cells", _cells(_dicts(result.get("cells")))),
        _table("Walks", _dicts(result.get("rows"))),
        _table("Cycles", [row for each in _dicts(result.get("speeds")) for row in _dicts(each.get("cycles"))]),
        _table("Comparisons of cycles", list(_comparisons(_dicts(result.get("speeds"))))),
        _table("Segments", list(_segments(result))),
    )
    return tuple(each for each in found if each is not None)


def headline(result: Mapping[str, Any]) -> str:
    """How many cells there are and how many of each verdict; empty where a result has no cells."""
    cells = _dicts(result.get("cells")) or _dicts(result.get("rows"))
    words = {str(each["cell"]): str(each[VERDICT]) for each in cells if "cell" in each and VERDICT in each}
    if not words:
        return ""
    counts = ", ".join(f"{count} {word}" for word, count in sorted(Counter(words.values()).items()))
    return f"{len(words)} cells: {counts}"


def _cells(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row for each figure of a cell; a cell without figures has one."""
    rows = []
    for cell in cells:
        figures, bars = _dict(cell.get("figures")), _dict(cell.get("bars"))
        own = {
            "cell": cell.get("cell"),
            VERDICT: cell.get(VERDICT),
            "trials": cell.get("trials"),
            "falls": len(cell.get("fell") or ()),
        }
        for name, value in (figures or {"": None}).items():
            unit = FIGURES[name].unit if name in FIGURES else ""
            rows.append(
                {**own, "figure": name, "value": value, "unit": unit, "bar": _dict(bars.get(name)).get("asked", "")}
            )
    return rows


def _comparisons(speeds: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    for speed in speeds:
        for each in _dicts(speed.get("comparisons")):
            planes = {f"shape distance, {plane}": value for plane, value in _dict(each.get("shape_distance")).items()}
            plain = {name: value for name, value in each.items() if name != "shape_distance"}
            yield {"speed_m_s": speed.get("speed_m_s"), **plain, **planes}


def _segments(result: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for one in (_dict(result.get("webots")), *map(_dict, _dict(result.get("stand_ins")).values())):
        for segment in _dicts(_dict(one.get("result")).get("segments")):
            plain = {name: value for name, value in segment.items() if isinstance(value, (str, int, float, type(None)))}
            yield {"engine": one.get("engine"), "status": one.get("status"), **plain}


def _table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table | None:
    """The rows under all their names; columns that are empty in every row are left out."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    names = [name for name in names if any(row.get(name) not in (None, "") for row in rows)]
    if not names:
        return None
    numeric = {
        place for place, name in enumerate(names) if all(_is_number(row.get(name)) for row in rows if row.get(name))
    }
    return Table(
        title=title,
        header=tuple(name.replace("_", " ") for name in names),
        rows=tuple(tuple(_text(row.get(name)) for name in names) for row in rows),
        numeric=frozenset(numeric),
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _text(value: Any) -> str:
    """A number with four digits, yes or no, or the text; a dash for what is missing."""
    if value is None or value == "" or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _dicts(value: Any) -> list[Mapping[str, Any]]:
    return [each for each in value if isinstance(each, Mapping)] if isinstance(value, (list, tuple)) else []


def _dict(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
