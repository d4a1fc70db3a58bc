"""Select windows of all clips according to the curation, and what a raised limit of a skill adds."""

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import pandas as pd

from pipeline.selection.curation import Curation, exclusions

COLUMNS = ("clip", "source", "file", "licence", "skill", "seconds")
"""Required columns. `off_skill_m_s` (purity), `recorded_share` and `notes` (codes, comma-separated) are
used where present."""


def choose(rows: pd.DataFrame, curation: Curation) -> pd.DataFrame:
    """Add `taken` (bool) and `why` (a sentence) to the rows, one per window.

    Excluded windows are removed first. Then each skill's seconds are filled in round-robin order over sources, within a
    source over files, and within a file by length, then purity. A window that does not fit the remaining seconds is
    skipped; shorter ones may follow. The order of the rows does not matter.
    """
    result = rows.copy()
    if rows.empty:
        return result.reindex(columns=[*dict.fromkeys([*COLUMNS, *rows.columns]), "taken", "why"])
    why = {row["clip"]: "; ".join(_objections(row, curation)) for row in rows.to_dict("records")}
    taken: set[str] = set()
    candidates = [row for row in rows.to_dict("records") if not why[row["clip"]]]
    for skill in sorted({row["skill"] for row in candidates}):
        most_s = curation.most_seconds.get(skill, float("inf"))
        used_s = 0.0
        for row in _in_turns([row for row in candidates if row["skill"] == skill]):
            if used_s + row["seconds"] <= most_s + 1e-9:
                used_s += row["seconds"]
                taken.add(row["clip"])
                why[row["clip"]] = "taken"
            else:
                why[row["clip"]] = f"the {most_s:g} s of {skill} are filled by other windows ({used_s:.1f} s so far)"
    result["taken"] = [clip in taken for clip in rows["clip"]]
    result["why"] = [why[clip] for clip in rows["clip"]]
    return result


def _objections(row: dict[str, Any], curation: Curation) -> Iterator[str]:
    """Reason to exclude a window, independent of the others; empty if there is none."""
    if row["skill"] not in curation.skills:
        yield f"skill '{row['skill']}' is not among the skills wanted"
    if row["seconds"] < curation.shortest_s:
        yield f"{row['seconds']:.2f} s is shorter than {curation.shortest_s:g} s"
    share = row.get("recorded_share")
    if share is not None and share < curation.least_recorded_share:
        least = curation.least_recorded_share
        yield f"{share:.0%} of its frames were recorded, at least {least:.0%} are needed to tell what they show"
    licence = row["licence"] if isinstance(row["licence"], str) else ""
    if not any(fnmatchcase(licence.lower(), pattern.lower()) for pattern in curation.licences):
        yield f"licence '{licence}' is not among those allowed ({', '.join(curation.licences) or 'none'})"
    excluded = exclusions(curation.decisions)
    for name in (row["clip"], _recording(row["clip"])):
        if name in excluded:
            yield excluded[name].text()
            break
    for pattern in curation.excluded_clips:
        if _fits(row["clip"], pattern):
            yield f"the clip is excluded by '{pattern}'"
    notes = row.get("notes")
    codes = notes.split(",") if isinstance(notes, str) else []
    for code in sorted(set(codes) & set(curation.excluded_notes)):
        yield f"the file has the note '{code}'"


def idle_patterns(rows: pd.DataFrame, curation: Curation) -> tuple[str, ...]:
    """Patterns of `excluded_clips` that match neither a window of `rows` nor its clip."""
    clips = [] if rows.empty else list(rows["clip"])
    return tuple(each for each in curation.excluded_clips if not any(_fits(clip, each) for clip in clips))


def _fits(window: str, pattern: str) -> bool:
    """Whether a pattern matches a window's name or the name of its clip."""
    return fnmatchcase(window, pattern) or fnmatchcase(_recording(window), pattern)


def _recording(window: str) -> str:
    """Name of a window's clip."""
    return window.rpartition("@")[0] or window


def _in_turns(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows in round-robin order over sources, within a source over files, within a file by rank."""
    return _alternate(_alternate(sorted(rows, key=_rank), "source", "file"), "source")


def _rank(row: dict[str, Any]) -> tuple[float, float, str]:
    """Longest first (to a tenth of a second), then the purest, then by name."""
    off = row.get("off_skill_m_s")
    return (-round(row["seconds"], 1), float(off) if off is not None and off == off else 0.0, row["clip"])


def _alternate(rows: list[dict[str, Any]], *columns: str) -> list[dict[str, Any]]:
    """The first row of each group with equal `columns`, by their text; then the second of each, and so on."""
    turns, seen = [], Counter[tuple[str, ...]]()
    for row in rows:
        group = tuple(str(row[each]) for each in columns)
        turns.append((seen[group], group, row))
        seen[group] += 1
    return [row for *_, row in sorted(turns, key=lambda turn: turn[:2])]


CLOSE_S = 1e-6
"""Tolerance for equal seconds [s]."""


@dataclass(frozen=True, kw_only=True)
class RaisedBound:
    """A raised limit of a skill, and the available windows."""

    skill: str
    bound_s: float | None
    """Previous limit [s]; None without a limit."""
    wanted_s: float | None
    """New limit [s]; None without a limit."""
    there_s: float
    """Seconds of windows that are eligible except for the limit."""
    before_s: float
    """Seconds selected under the previous limit."""
    taken_s: float
    """Seconds selected under the new limit."""
    more_windows: int
    """Number of windows selected now and not before."""
    fewer_windows: int
    """Number of windows selected before and not now: shorter ones that were replaced."""

    @property
    def reached(self) -> bool:
        """Whether the previous limit excluded windows."""
        return self.there_s > self.before_s + CLOSE_S

    @property
    def all_taken(self) -> bool:
        """Whether all eligible windows are selected."""
        return self.taken_s > self.there_s - CLOSE_S

    @property
    def short(self) -> bool:
        """Whether the limit exceeds what is available: only new recordings add more."""
        return self.all_taken and (self.wanted_s is None or self.wanted_s > self.there_s + CLOSE_S)

    def text(self) -> str:
        """One line for a report."""
        if self.bound_s is None:
            head = f"{self.skill}: feedback requests more, there is no limit, {self.there_s:.1f} s are available"
        else:
            head = f"{self.skill}: feedback requests {self.wanted_s:g} s, {self.there_s:.1f} s are available"
        if not self.reached:
            limit = "" if self.bound_s is None else f", the limit of {self.bound_s:g} s excluded none"
            return f"{head}: no more windows{limit}; record more of this skill"
        if not self.more_windows:
            return f"{head}: {self.taken_s:.1f} s selected as before, because none of the other windows fits the limit"
        windows = f"{self.more_windows} more window{'s' if self.more_windows > 1 else ''}"
        replaced = f" instead of {self.fewer_windows} shorter" if self.fewer_windows else ""
        rest = "which is all of them" if self.all_taken else f"{self.there_s - self.taken_s:.1f} s not selected"
        rest += "; record more of this skill" if self.short else ""
        return (
            f"{head}: {windows}{replaced}, from {self.before_s:.1f} s "
            f"(limit {self.bound_s:g} s) to {self.taken_s:.1f} s, {rest}"
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON types, with derived values and the text."""
        return {**dataclasses.asdict(self), "reached": self.reached, "short": self.short, "text": self.text()}


def raised_bounds(
    rows: pd.DataFrame, before: Curation, after: Curation, skills: Iterable[str]
) -> tuple[RaisedBound, ...]:
    """Effect of the limits of `after` against `before` for some skills; `rows` as for `choose`."""
    wanted = sorted(set(skills))
    if not wanted:
        return ()
    uncapped = dataclasses.replace(after, most_seconds={})
    there, old, new = (_seconds(choose(rows, each)) for each in (uncapped, before, after))
    result = []
    for skill in wanted:
        seconds = [each.get(skill, {}) for each in (there, old, new)]
        there_s, before_s, taken_s = (round(sum(each.values()), 6) for each in seconds)
        result.append(
            RaisedBound(
                skill=skill,
                bound_s=before.most_seconds.get(skill),
                wanted_s=after.most_seconds.get(skill),
                there_s=there_s,
                before_s=before_s,
                taken_s=taken_s,
                more_windows=len(seconds[2].keys() - seconds[1].keys()),
                fewer_windows=len(seconds[1].keys() - seconds[2].keys()),
            )
        )
    return tuple(result)


def _seconds(choice: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Skill -> selected window -> its seconds."""
    found: dict[str, dict[str, float]] = {}
    for row in choice.to_dict("records"):
        if row["taken"]:
            found.setdefault(str(row["skill"]), {})[str(row["clip"])] = float(row["seconds"])
    return found
