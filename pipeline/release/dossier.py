"""What a person reads before a policy goes to a robot, as data: card, lineage, verdicts, pictures, what was not run.

A check has passed only where its result says so in so many words, of this very policy, and is not outdated. All else is
failed, failed to run, outdated or not run, and the page says which; nothing without a verdict counts as passed.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


class Status(enum.Enum):
    """What came of a check."""

    PASSED = "passed"
    FAILED = "failed"
    OUTDATED = "outdated"
    """It was run, but of another policy, or what it depends on has changed since."""
    FAILED_TO_RUN = "failed to run"
    """It was started and gave no verdict: it crashed, took too long, or what it said can't be read."""
    NOT_RUN = "not run"


@dataclass(frozen=True, kw_only=True)
class Picture:
    """An image that the page holds."""

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
    """Why it failed, is outdated or was not run; every reason."""
    not_required: tuple[str, ...] = ()
    """What fails or differs and is not asked for."""
    not_run: tuple[str, ...] = ()
    """Parts of it that were not run."""
    failed_to_run: tuple[str, ...] = ()
    """What of it was started and gave no verdict, and how that came."""
    facts: tuple[tuple[str, str], ...] = ()
    """What else its result says, name and value."""
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Dossier:
    """Everything on the page."""

    title: str
    policy: str
    """Digest of network and gains; empty where there is no policy."""
    card: tuple[tuple[str, str], ...]
    lineage: tuple[tuple[str, str, str], ...]
    """Asset, version of its content, what is said of it."""
    verdicts: tuple[Verdict, ...]
    pictures: tuple[Picture, ...] = ()
    conditions: tuple[str, ...] = field(default_factory=tuple)
    """What holds for its use: licence, command range, whether it may ship."""

    @property
    def open_points(self) -> tuple[str, ...]:
        """Why it can't be signed without a word: each check that has not passed, each part that was not run or failed
        to run."""
        if not self.policy:
            return ("there is no policy",)
        told = (Status.PASSED, Status.FAILED_TO_RUN)
        points = [f"{each.name}: {each.status.value}" for each in self.verdicts if each.status not in told]
        points += [f"{each.name}: {text}" for each in self.verdicts for text in each.failed_to_run]
        points += [f"{each.name}: not run: {text}" for each in self.verdicts for text in each.not_run]
        return tuple(points) if self.verdicts else ("nothing was checked",)


def judged(
    name: str, result: Mapping[str, Any] | None, policy: str, outdated: str = "", pictures: Sequence[Picture] = ()
) -> Verdict:
    """The verdict that a check's stored result amounts to.

    Args:
        name: of the check
        result: what it stored: `passed` (true, false, or null where there is no verdict), `policy` (digest), and
            `reasons`, `not_required`, `not_run`, `failed_to_run` where there are any; None where nothing is stored
        policy: digest of the policy that is to be signed
        outdated: why its result no longer holds, empty where it does
        pictures: that it made
    """
    if result is None:
        return Verdict(name=name, status=Status.NOT_RUN, reasons=("it was never run here",))
    reasons = _texts(result.get("reasons"))
    parts = _texts(result.get("not_run", result.get("not run")))
    spared = _texts(result.get("not_required", result.get("not required")))
    broken = _texts(result.get("failed_to_run"))
    status, why = _status(result, policy, outdated, bool(broken))
    if status in (Status.NOT_RUN, Status.FAILED_TO_RUN):
        reasons, parts = (*parts, *reasons), ()
    return Verdict(
        name=name,
        status=status,
        reasons=(*why, *reasons),
        not_required=spared,
        not_run=parts,
        failed_to_run=broken,
        facts=_facts(result),
        pictures=tuple(pictures),
    )


def _status(result: Mapping[str, Any], policy: str, outdated: str, broken: bool) -> tuple[Status, tuple[str, ...]]:
    passed, of = result.get("passed"), result.get("policy")
    if passed is None and not broken:
        return Status.NOT_RUN, ()
    if of is None:
        return Status.OUTDATED, ("its result does not say of which policy it is",)
    if of != policy:
        return Status.OUTDATED, (f"it is of the policy {str(of)[:12]}, not of {policy[:12]}",)
    if outdated:
        return Status.OUTDATED, (outdated,)
    if passed is None:
        return Status.FAILED_TO_RUN, ()
    return (Status.PASSED if passed is True else Status.FAILED), ()


def _texts(value: Any) -> tuple[str, ...]:
    """Reasons given as text, as a list or as name -> reasons."""
    if value in (None, "", (), []):
        return ()
    if isinstance(value, str):
        return (value,)
    if isinstance(value, Mapping):
        return tuple(f"{name}: {'; '.join(_texts(why))}" if _texts(why) else str(name) for name, why in value.items())
    return tuple(str(each) for each in value)


_OWN = ("passed", "policy", "reasons", "not_required", "not required", "not_run", "not run", "failed_to_run", "stage")


def _facts(result: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Numbers and texts of a result; lists and tables of cells stay in the asset."""
    plain = {name: value for name, value in result.items() if name not in _OWN and isinstance(value, (str, int, float))}
    return tuple((name.replace("_", " "), _number(value)) for name, value in sorted(plain.items()))


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
