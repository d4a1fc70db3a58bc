"""Data of the release report: card, lineage, verdicts, pictures, tables of figures with their thresholds.

A check has passed only if its result states it explicitly, belongs to this policy and is not outdated. Any other check
is failed, failed to run, outdated or not run.
"""

import enum
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pipeline.validation.figures import FIGURES

VERDICT = "verdict"
"""Column whose values are shown in the colour of their status."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of texts with a header; each row has one text per column."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: frozenset[int] = frozenset()
    """Indices of numeric columns."""


def tables_of(result: Mapping[str, Any]) -> tuple[Table, ...]:
    """Tables of a stored result (suite, engines, limit cycles, segments). Parts in another format are left out."""
    found = (
        _table("Cells", _cells(_dicts(result.get("cells")))),
        _table("Walks", _dicts(result.get("rows"))),
        _table("Cycles", [row for each in _dicts(result.get("speeds")) for row in _dicts(each.get("cycles"))]),
        _table("Comparisons of cycles", list(_comparisons(_dicts(result.get("speeds"))))),
        _table("Segments", list(_segments(result))),
    )
    return tuple(each for each in found if each is not None)


def headline(result: Mapping[str, Any]) -> str:
    """Number of cells in total and by verdict; empty for a result without cells."""
    cells = _dicts(result.get("cells")) or _dicts(result.get("rows"))
    words = {str(each["cell"]): str(each[VERDICT]) for each in cells if "cell" in each and VERDICT in each}
    if not words:
        return ""
    counts = ", ".join(f"{count} {word}" for word, count in sorted(Counter(words.values()).items()))
    return f"{len(words)} cells: {counts}"


def _cells(cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per figure of each cell; one row for a cell without figures."""
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
    """A table with all columns of the rows, without columns that are empty in every row; None without rows."""
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
    """Format a value: numbers with four digits, booleans as yes or no; a dash for a missing value."""
    if value is None or value == "" or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _dicts(value: Any) -> list[Mapping[str, Any]]:
    return [each for each in value if isinstance(each, Mapping)] if isinstance(value, (list, tuple)) else []


def _dict(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


class Status(enum.Enum):
    """Status of a check."""

    PASSED = "passed"
    FAILED = "failed"
    OUTDATED = "outdated"
    """Its result is of another policy, or one of its inputs has changed since."""
    FAILED_TO_RUN = "failed to run"
    """It was started and gave no verdict: crash, timeout or invalid output."""
    NOT_RUN = "not run"


@dataclass(frozen=True, kw_only=True)
class Picture:
    """An image embedded in the page."""

    caption: str
    data: bytes
    kind: str = "png"
    """`png` or `gif`."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """One check of the policy."""

    name: str
    status: Status
    reasons: tuple[str, ...] = ()
    """Every reason why it failed, is outdated or was not run."""
    not_required: tuple[str, ...] = ()
    """Failures that are not required."""
    not_run: tuple[str, ...] = ()
    """Parts of it that were not run."""
    failed_to_run: tuple[str, ...] = ()
    """Parts that were started and gave no verdict, with the cause."""
    facts: tuple[tuple[str, str], ...] = ()
    """Other facts of its result, name and value."""
    headline: str = ""
    """Summary: numbers of passed and failed cells."""
    tables: tuple[Table, ...] = ()
    """Measured figures with their thresholds."""
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Origin:
    """An asset in the lineage of the policy, its data or a verdict."""

    asset: str
    version: str
    """Digest of its content."""
    remark: str = ""
    """Why it is stale or missing; else empty."""
    facts: tuple[tuple[str, str], ...] = ()
    """Facts of its last materialization, name and value."""


@dataclass(frozen=True, kw_only=True)
class Dossier:
    """Everything on the page."""

    title: str
    policy: str
    """Digest of network and gains; empty without a policy."""
    card: tuple[tuple[str, str], ...]
    lineage: tuple[Origin, ...]
    verdicts: tuple[Verdict, ...]
    pictures: tuple[Picture, ...] = ()
    conditions: tuple[str, ...] = field(default_factory=tuple)
    """Conditions of use: licence, command range, whether it may ship."""

    @property
    def open_points(self) -> tuple[str, ...]:
        """Why the report is not ready to sign: checks that have not passed, parts that were not run."""
        if not self.policy:
            return ("there is no policy",)
        listed = (Status.PASSED, Status.FAILED_TO_RUN)
        points = [f"{each.name}: {each.status.value}" for each in self.verdicts if each.status not in listed]
        points += [f"{each.name}: {text}" for each in self.verdicts for text in each.failed_to_run]
        points += [f"{each.name}: not run: {text}" for each in self.verdicts for text in each.not_run]
        return tuple(points) if self.verdicts else ("nothing was checked",)


def verdict_of(
    name: str, result: Mapping[str, Any] | None, policy: str, outdated: str = "", pictures: Sequence[Picture] = ()
) -> Verdict:
    """The verdict of a check from its stored result.

    Args:
        name: name of the check
        result: stored result: `passed` (true, false, or null without a verdict), `policy` (digest), and optionally
            `reasons`, `not_required`, `not_run`, `failed_to_run`; None if nothing is stored
        policy: digest of the policy to sign
        outdated: why the result is outdated; empty if it is current
        pictures: pictures of the check
    """
    if result is None:
        return Verdict(name=name, status=Status.NOT_RUN, reasons=("it was never run here",))
    reasons = _texts(result.get("reasons"))
    parts = _texts(result.get("not_run", result.get("not run")))
    optional = _texts(result.get("not_required", result.get("not required")))
    broken = _texts(result.get("failed_to_run"))
    status, why = _status(result, policy, outdated, bool(broken))
    if status in (Status.NOT_RUN, Status.FAILED_TO_RUN):
        reasons, parts = (*parts, *reasons), ()
    return Verdict(
        name=name,
        status=status,
        reasons=(*why, *reasons),
        not_required=optional,
        not_run=parts,
        failed_to_run=broken,
        facts=_facts(result),
        headline=headline(result),
        tables=tables_of(result),
        pictures=tuple(pictures),
    )


def _status(result: Mapping[str, Any], policy: str, outdated: str, broken: bool) -> tuple[Status, tuple[str, ...]]:
    passed, of = result.get("passed"), result.get("policy")
    if passed is None and not broken:
        return Status.NOT_RUN, ()
    if of is None:
        return Status.OUTDATED, ("its result names no policy",)
    failed = ("it failed when it was run",) if passed is False else ()
    if of != policy:
        return Status.OUTDATED, (f"it evaluated the policy {str(of)[:12]}, not {policy[:12]}", *failed)
    if outdated:
        return Status.OUTDATED, (outdated, *failed)
    if passed is None:
        return Status.FAILED_TO_RUN, ()
    return (Status.PASSED if passed is True else Status.FAILED), ()


def _texts(value: Any) -> tuple[str, ...]:
    """Reasons from a text, a list or a mapping name -> reasons."""
    if value in (None, "", (), []):
        return ()
    if isinstance(value, str):
        return (value,)
    if isinstance(value, Mapping):
        return tuple(f"{name}: {'; '.join(_texts(why))}" if _texts(why) else str(name) for name, why in value.items())
    return tuple(str(each) for each in value)


_OWN = ("passed", "policy", "reasons", "not_required", "not required", "not_run", "not run", "failed_to_run", "stage")


def _facts(result: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Numbers and texts of a result, without lists and tables."""
    plain = {name: value for name, value in result.items() if name not in _OWN and isinstance(value, (str, int, float))}
    return tuple((name.replace("_", " "), _text(value)) for name, value in sorted(plain.items()))
