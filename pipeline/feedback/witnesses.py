"""Failures by what they are of, and the logs that are their witnesses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from pipeline.failures.failure import Failure
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.change import Witness

Pair = tuple[TrialReport, Failure]
NamedBy = Callable[[tuple[float, float, float]], str]
"""What a command is called: its cell, its skill."""


def grouped(
    pairs: Iterable[Pair], trials: Sequence[TrialReport], kinds: tuple[str, ...], least_share: float, name: NamedBy
) -> dict[str, list[Pair]]:
    """Failures by what their command is called, where enough of the logs with such a command have one."""
    groups: dict[str, list[Pair]] = {}
    for report, failure in pairs:
        if failure.kind in kinds and report.command_known and failure.command_known:
            groups.setdefault(name(failure.command), []).append((report, failure))
    tried: dict[str, set[str]] = {}
    for report in trials:
        for *command, _ in report.commands:
            tried.setdefault(name((command[0], command[1], command[2])), set()).add(report.sha256)
    return {
        key: group
        for key, group in sorted(groups.items())
        if len(logs_of(group)) >= least_share * len(tried.get(key, set()) | logs_of(group))
    }


def logs_of(group: Iterable[Pair]) -> set[str]:
    return {report.sha256 for report, _ in group}


def witnesses_of(group: Iterable[Pair]) -> tuple[Witness, ...]:
    """One a log: its surest failure."""
    surest: dict[str, Pair] = {}
    for report, failure in group:
        if report.sha256 not in surest or failure.confidence > surest[report.sha256][1].confidence:
            surest[report.sha256] = (report, failure)
    return tuple(
        Witness(
            trial=report.trial,
            log=report.file,
            sha256=report.sha256,
            policy=report.policy,
            simulated=report.simulated,
            said=failure.text(),
        )
        for report, failure in sorted(surest.values(), key=lambda pair: pair[0].trial)
    )
