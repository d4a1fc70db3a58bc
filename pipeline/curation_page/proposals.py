"""Proposed changes with their evidence, and the answers to them, as the page shows them."""

from __future__ import annotations

from typing import Any

from pipeline.errors import FileError
from pipeline.feedback.approve import FeedbackFiles
from pipeline.feedback.change import SECTIONS, Change, place_of, proposal_digest
from pipeline.feedback.trust import is_demonstration


def proposals(files: FeedbackFiles) -> dict[str, Any]:
    """The pending proposal, what is approved and what can't be used, as JSON types."""
    try:
        changes = files.proposed()
        missing = ""
    except FileError as error:
        changes, missing = (), str(error)
    approvals, declined = files.approvals(), files.declined_changes()
    places = {place_of(change) for change in changes}
    return {
        "proposal": proposal_digest(changes),
        "missing": missing,
        "sections": SECTIONS,
        "changes": [_change(each, _answer(each, approvals.changes, declined)) for each in changes],
        "lingering": [_change(each, "approved") for each in approvals.changes if place_of(each) not in places],
        "approved": [
            {"section": entry.section, "by": entry.by, "proposal": entry.proposal, "changes": len(entry.changes)}
            for entry in approvals.entries
        ],
        "faults": sorted({str(fault) for fault in approvals.faults.values()}),
    }


def _answer(change: Change, approved: tuple[Change, ...], declined: tuple[Change, ...]) -> str:
    return "approved" if change in approved else "declined" if change in declined else "pending"


def _change(change: Change, answer: str) -> dict[str, Any]:
    return {
        "section": change.section,
        "robot": change.robot,
        "what": change.what,
        "before": change.before,
        "value": change.value,
        "bound": change.bound,
        "counted": change.counted(),
        "demonstration": is_demonstration(change),
        "answer": answer,
        "evidence": [
            {
                "trial": each.trial,
                "log": each.log,
                "sha256": each.sha256,
                "policy": each.policy,
                "simulated": each.simulated,
                "text": each.said,
            }
            for each in change.witnesses
        ],
    }
