"""Failures by what they are of, and the recordings that are their witnesses."""

from __future__ import annotations

import math
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
    """Failures by what their command is called, where enough of what was commanded so has one.

    Each experiment with such a command weighs as much as any other, by the share of its recordings that failed.
    """
    groups: dict[str, list[Pair]] = {}
    for heard, failure in pairs:
        if failure.kind in kinds and heard.report.command_known and failure.command_known:
            groups.setdefault(name(failure.command), []).append((heard, failure))
    tried: dict[str, list[Heard]] = {}
    for heard in trials:
        for *command, _ in heard.report.commands:
            tried.setdefault(name((command[0], command[1], command[2])), []).append(heard)
    return {
        key: group
        for key, group in sorted(groups.items())
        if _fails_enough([heard for heard, _ in group], tried.get(key, []), least_share)
    }


def _fails_enough(failed: Sequence[Heard], tried: Sequence[Heard], least_share: float) -> bool:
    """Whether the mean share of failed recordings over the experiments is large enough."""
    had, all_of = _recordings(failed), _recordings([*failed, *tried])
    shares = [len(had.get(experiment, set())) / len(recordings) for experiment, recordings in all_of.items()]
    return math.fsum(shares) >= least_share * len(shares)


def _recordings(heard: Iterable[Heard]) -> dict[str, set[str]]:
    """Experiment -> its recordings."""
    found: dict[str, set[str]] = {}
    for each in heard:
        found.setdefault(each.experiment, set()).add(each.recording)
    return found


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
