"""Failures by what they are of, and the recordings that are their witnesses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from pipeline.failures.failure import Failure
from pipeline.feedback.change import Witness
from pipeline.feedback.recordings import Heard

Pair = tuple[Heard, Failure]
NamedBy = Callable[[tuple[float, float, float]], str]
"""What a command is called: its cell, its skill."""


def grouped(
    pairs: Iterable[Pair], trials: Sequence[Heard], kinds: tuple[str, ...], least_share: float, name: NamedBy
) -> dict[str, list[Pair]]:
    """Failures by what their command is called, where enough of the recordings with such a command have one."""
    groups: dict[str, list[Pair]] = {}
    for heard, failure in pairs:
        if failure.kind in kinds and heard.report.command_known and failure.command_known:
            groups.setdefault(name(failure.command), []).append((heard, failure))
    tried: dict[str, set[str]] = {}
    for heard in trials:
        for *command, _ in heard.report.commands:
            tried.setdefault(name((command[0], command[1], command[2])), set()).add(heard.recording)
    return {
        key: group
        for key, group in sorted(groups.items())
        if len(recordings_of(group)) >= least_share * len(tried.get(key, set()) | recordings_of(group))
    }


def recordings_of(group: Iterable[Pair]) -> set[str]:
    return {heard.recording for heard, _ in group}


def witnesses_of(group: Iterable[Pair]) -> tuple[Witness, ...]:
    """One a recording: its surest failure. So the logs of a change are as many as its recordings."""
    surest: dict[str, Pair] = {}
    for heard, failure in group:
        if heard.recording not in surest or failure.confidence > surest[heard.recording][1].confidence:
            surest[heard.recording] = (heard, failure)
    return tuple(
        Witness(
            trial=heard.report.trial,
            log=heard.report.file,
            sha256=heard.report.sha256,
            policy=heard.report.policy,
            simulated=heard.report.simulated,
            said=failure.text(),
        )
        for heard, failure in sorted(surest.values(), key=lambda pair: pair[0].report.trial)
    )
