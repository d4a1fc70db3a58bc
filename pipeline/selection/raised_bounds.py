"""What a raised bound of a skill brings: more windows where it cut some off, and nothing where it did not."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pipeline.selection.choose import choose
from pipeline.selection.curation import Curation

CLOSE_S = 1e-6
"""Seconds that differ by less are the same."""


@dataclass(frozen=True, kw_only=True)
class RaisedBound:
    """More seconds wanted of a skill, and what there was to take."""

    skill: str
    bound_s: float | None
    """Most seconds before; None for a skill without a bound."""
    wanted_s: float | None
    """Most seconds now."""
    there_s: float
    """Seconds of the windows that nothing but a bound keeps out."""
    before_s: float
    """Seconds taken with the bound before."""
    taken_s: float
    """Seconds taken now."""
    more_windows: int
    """Windows taken that were not before."""
    fewer_windows: int
    """Shorter windows that made room for them."""

    @property
    def reached(self) -> bool:
        """Whether the bound before cut windows off."""
        return self.there_s > self.before_s + CLOSE_S

    @property
    def all_taken(self) -> bool:
        """Whether no window is left to take."""
        return self.taken_s > self.there_s - CLOSE_S

    @property
    def short(self) -> bool:
        """Whether more is wanted than there is: only a recording brings more."""
        return self.all_taken and (self.wanted_s is None or self.wanted_s > self.there_s + CLOSE_S)

    def text(self) -> str:
        """A sentence for a report."""
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
        """As JSON types, with what follows from them and the sentence."""
        return {**dataclasses.asdict(self), "reached": self.reached, "short": self.short, "said": self.text()}


def raised_bounds(
    rows: pd.DataFrame, before: Curation, after: Curation, skills: Iterable[str]
) -> tuple[RaisedBound, ...]:
    """What the bounds of `after` bring of some skills against those of `before`; `rows` as `choose` takes them."""
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
    """Skill -> window that was taken -> its seconds."""
    found: dict[str, dict[str, float]] = {}
    for row in choice.to_dict("records"):
        if row["taken"]:
            found.setdefault(str(row["skill"]), {})[str(row["clip"])] = float(row["seconds"])
    return found


def _sum(seconds: dict[str, float]) -> float:
    return round(sum(seconds.values()), 6)


def _windows(count: int) -> str:
    return f"{count} more window{'s' if count > 1 else ''}"
