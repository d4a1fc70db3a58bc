"""Which logs and which failures count, and why the others do not."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fnmatch import fnmatchcase

from pipeline.failures.failure import Failure
from pipeline.failures.trial_report import VERIFIED, TrialReport
from pipeline.feedback.change import Change, Witness
from pipeline.feedback.recordings import Heard
from pipeline.feedback.rules import FeedbackRules, TrustRules

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


DEMONSTRATION = "demo/"
"""Logs of this folder show the loop. They count until there is a log of one's own, and never without a person."""


def trusted(reports: Sequence[TrialReport], rules: FeedbackRules) -> tuple[list[TrialReport], list[str]]:
    """The reports that count, and why the others do not.

    What is simulated gives way to what is real, and what is shown to what is one's own, but only to logs that count.
    """
    trust = rules.trust
    doubts = [_doubt(report, trust) for report in reports]
    sound = [report for report, doubt in zip(reports, doubts, strict=True) if not doubt]
    real = {report.robot for report in sound if not report.simulated}
    own = {report.robot for report in sound if not _is_shown(report.file)}
    kept, silent = [], []
    for report, why in zip(reports, doubts, strict=True):
        if not why and report.simulated and trust.simulated == "until_real" and report.robot in real:
            why = f"it is simulated, and there are logs of a real {report.robot}"
        elif not why and _is_shown(report.file) and report.robot in own:
            why = f"it is of the demonstration, and there are other logs of the {report.robot}"
        if why:
            silent.append(f"{report.trial} ({report.file}) does not count: {why}")
        else:
            kept.append(report)
    return kept, silent


def _doubt(report: TrialReport, trust: TrustRules) -> str:
    """Why a log by itself does not count; empty if it does."""
    if not report.policy:
        return "it does not say which policy walked"
    if not any(fnmatchcase(report.policy, pattern) for pattern in trust.policies):
        return f"policy {report.policy[:12]} is not among those whose logs count"
    if report.integrity != VERIFIED and not trust.unverified:
        return "no checksum covers its bytes"
    return "it is simulated" if report.simulated and trust.simulated == "never" else ""


def _is_shown(log: str) -> bool:
    return log.startswith(DEMONSTRATION)


def is_demonstration(change: Change) -> bool:
    """Whether a change rests on logs of the demonstration alone."""
    return all(_is_shown(each.log) for each in change.witnesses)


def doubt_of(failure: Failure, rules: FeedbackRules) -> str:
    """Why a failure of a policy does not count; empty if it does."""
    if failure.confidence < rules.trust.least_confidence:
        return f"the confidence {failure.confidence:.2f} is below {rules.trust.least_confidence:g}"
    if failure.kind == "fall" and rules.trust.attitude_confirms and not failure.evidence.get("attitude"):
        return "the attitude does not show a fall"
    return ""
