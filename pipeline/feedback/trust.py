"""Which logs and which failures count, and why the others do not."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

from pipeline.failures.failure import Failure
from pipeline.failures.trial_report import VERIFIED, TrialReport
from pipeline.feedback.rules import FeedbackRules


def trusted(reports: Sequence[TrialReport], rules: FeedbackRules) -> tuple[list[TrialReport], list[str]]:
    """The reports that count, and why the others do not."""
    trust, kept, silent = rules.trust, [], []
    real = {report.robot for report in reports if not report.simulated}
    for report in reports:
        why = ""
        if not report.policy:
            why = "it does not say which policy walked"
        elif not any(fnmatchcase(report.policy, pattern) for pattern in trust.policies):
            why = f"policy {report.policy[:12]} is not among those whose logs count"
        elif report.integrity != VERIFIED and not trust.unverified:
            why = "no checksum covers its bytes"
        elif report.simulated and trust.simulated == "never":
            why = "it is simulated"
        elif report.simulated and trust.simulated == "until_real" and report.robot in real:
            why = f"it is simulated, and there are logs of a real {report.robot}"
        if why:
            silent.append(f"{report.trial} ({report.file}) does not count: {why}")
        else:
            kept.append(report)
    return kept, silent


def doubt_of(failure: Failure, rules: FeedbackRules) -> str:
    """Why a failure of a policy does not count; empty if it does."""
    if failure.confidence < rules.trust.least_confidence:
        return f"the confidence {failure.confidence:.2f} is below {rules.trust.least_confidence:g}"
    if failure.kind == "fall" and rules.trust.attitude_confirms and not failure.evidence.get("attitude"):
        return "the attitude does not show a fall"
    return ""
