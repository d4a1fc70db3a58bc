"""Reports of trials with planted failures, as the rules of feedback see them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.failures.failure import Failure
from pipeline.failures.trial_report import TrialReport
from pipeline.feasibility import CommandSettings
from pipeline.feedback.propose import Proposal, propose
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import settings
from pipeline.selection import Curation

DATA = Path(__file__).resolve().parents[2] / "data"
RULES = settings.read(DATA / "feedback_rules.yaml", FeedbackRules)
COMMANDS = settings.read(DATA / "commands.yaml", CommandSettings)
CURATION = settings.read(DATA / "curation.yaml", Curation)

LEFT = (0.0, 0.4, 0.0)
LEFT_CELL = "0.0 m/s, 0.4 m/s, 0.0 rad/s"


def failure(kind: str = "fall", **more: Any) -> Failure:
    """A fall to the left while walking left, that the attitude shows."""
    said: dict[str, Any] = {
        "time_s": 3.0,
        "until_s": 3.5,
        "command": LEFT,
        "confidence": 0.99,
        "evidence": {"attitude": True},
    }
    return Failure(kind=kind, **{**said, **more})


def saturated(given: float) -> Failure:
    """A knee that gave `given` of its 60 N m."""
    return failure("torque_saturation", joint="Left_Knee_Pitch", evidence={"given_n_m": given, "limit_n_m": 60.0})


def report(number: int, *failures: Failure, **more: Any) -> TrialReport:
    """The report of log `number`, commanded to the left for 5 s."""
    said: dict[str, Any] = {
        "trial": f"trial{number:03d}",
        "file": f"log{number:03d}.mcap",
        "sha256": f"{number:064d}",
        "robot": "t1",
        "policy": "a" * 64,
        "simulated": False,
        "integrity": "verified",
        "seconds": 8.0,
        "commands": ((*LEFT, 5.0),),
    }
    return TrialReport(failures=failures, **{**said, **more})


def proposal(*reports: TrialReport, rules: FeedbackRules = RULES) -> Proposal:
    """What the shipped rules, or others, make of reports."""
    return propose(reports, rules, COMMANDS, CURATION.windows.bounds)


def values(found: Proposal) -> dict[tuple[str, str], float]:
    """(section, what) -> value."""
    return {(change.section, change.what): change.value for change in found.changes}
