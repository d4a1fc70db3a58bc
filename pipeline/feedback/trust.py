"""Which logs and which failures count, and why the others do not."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from pipeline.failures.failure import Failure
from pipeline.failures.trial_report import VERIFIED, TrialReport
from pipeline.feedback.change import Change
from pipeline.feedback.rules import FeedbackRules, TrustRules

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
