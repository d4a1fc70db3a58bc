"""Effect of a raised limit of a skill: more windows if the limit excluded some, otherwise none."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pipeline.selection.choose import choose
from pipeline.selection.curation import Curation

CLOSE_S = 1e-6
"""Tolerance for equal seconds [s]."""


@dataclass(frozen=True, kw_only=True)
class RaisedBound:
    """A raised limit of a skill, and the available windows."""

    skill: str
    bound_s: float | None
    """Previous limit [s]; None without a limit."""
    wanted_s: float | None
    """New limit [s]."""
    there_s: float
    """Seconds of windows that are eligible except for the limit."""
    before_s: float
    """Seconds selected under the previous limit."""
    taken_s: float
    """Seconds selected now."""
    more_windows: int
    """Windows selected now and not before."""
    fewer_windows: int
    """Shorter windows that were dropped for them."""

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
            head = f"{self.skill}: more was wanted by feedback, it has no bound, {self.there_s:.1f} s are there"
        else:
            head = f"{self.skill}: wanted {self.wanted_s:g} s by feedback, {self.there_s:.1f} s are there"
        if not self.reached:
            bound = "" if self.bound_s is None else f", the bound of {self.bound_s:g} s cut none off"
            return f"{head}: no more windows to take{bound}; record more of it"
        if not self.more_windows:
            return f"{head}: {self.taken_s:.1f} s taken as before, none of the windows left out fits in"
        room = f" in place of {self.fewer_windows} shorter" if self.fewer_windows else ""
        rest = "that is all of it" if self.all_taken else f"{self.there_s - self.taken_s:.1f} s left out"
        rest += "; record more" if self.short else ""
        return (
            f"{head}: {_windows(self.more_windows)}{room}, from {self.before_s:.1f} s "
            f"(bound {self.bound_s:g} s) to {self.taken_s:.1f} s, {rest}"
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
    there, old, new = (
        _seconds(choose(rows, each)) for each in (dataclasses.replace(after, most_seconds={}), before, after)
    )
    return tuple(
        RaisedBound(
            skill=skill,
            bound_s=before.most_seconds.get(skill),
            wanted_s=after.most_seconds.get(skill),
            there_s=_sum(there.get(skill, {})),
            before_s=_sum(old.get(skill, {})),
            taken_s=_sum(new.get(skill, {})),
            more_windows=len(new.get(skill, {}).keys() - old.get(skill, {}).keys()),
            fewer_windows=len(old.get(skill, {}).keys() - new.get(skill, {}).keys()),
        )
        for skill in wanted
    )


def _seconds(choice: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Skill -> selected window -> its seconds."""
    found: dict[str, dict[str, float]] = {}
    for row in choice.to_dict("records"):
        if row["taken"]:
            found.setdefault(str(row["skill"]), {})[str(row["clip"])] = float(row["seconds"])
    return found


def _sum(seconds: dict[str, float]) -> float:
    return round(sum(seconds.values()), 6)


def _windows(count: int) -> str:
    return f"{count} more window{'s' if count > 1 else ''}"
