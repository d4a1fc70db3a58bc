"""What the page of curation_feedback says: what waits, what is approved, what can't be used, how to go on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import dagster as dg
import pandas as pd

from assets.curator_link import curator_link
from assets.report import table_of
from pipeline.feedback.approved import Approvals
from pipeline.feedback.change import Change, place_of
from pipeline.feedback.trust import is_demonstration
from pipeline.files.shown_text import markdown_list

if TYPE_CHECKING:
    from pipeline.feedback.propose import Proposal

SHOWN = (
    "rests on the logs of data/hardware_logs/demo alone, which ship to show the loop: approve it to try the loop, or "
    "leave it. It gives way to the first log of your own that counts, and never takes effect without a person."
)


@dataclass(frozen=True, kw_only=True)
class FeedbackPage:
    """A proposal beside what is approved."""

    proposal: Proposal
    approvals: Approvals
    pending: tuple[Change, ...]
    """What is proposed and not approved."""
    lingering: tuple[Change, ...]
    """What is approved and proposed no longer."""
    declined: tuple[Change, ...] = ()
    """What is proposed and a person declined."""

    @staticmethod
    def of(proposal: Proposal, approvals: Approvals, declined: Sequence[Change] = ()) -> FeedbackPage:
        """Compare a proposal with the answers to it. An approval of a number that is proposed with another value is
        pending, not lingering."""
        approved = approvals.changes
        places = {place_of(each) for each in proposal.changes}
        return FeedbackPage(
            proposal=proposal,
            approvals=approvals,
            pending=tuple(each for each in proposal.changes if each not in approved and each not in declined),
            lingering=tuple(each for each in approved if place_of(each) not in places),
            declined=tuple(each for each in proposal.changes if each in declined and each not in approved),
        )

    @property
    def nothing_waits(self) -> bool:
        """Whether nobody has to do anything. What only shows the loop can wait for ever."""
        return not self.approvals.faults and all(is_demonstration(each) for each in self.pending)

    def sentence(self) -> str:
        """What waits."""
        if self.approvals.faults:
            return self._faults()
        if not self.pending:
            return "nothing waits"
        if self.nothing_waits:
            return f"nothing of yours waits; what is proposed ({len(self.pending)} changes) {SHOWN}"
        return f"{len(self.pending)} changes wait for approval"

    def _faults(self) -> str:
        faults = dict.fromkeys(str(fault) for fault in self.approvals.faults.values())
        return " ".join(faults)

    def metadata(self, digest: str) -> dict[str, Any]:
        """The rows of the page; tables come last."""
        rows = [self._row(each) for each in self.proposal.changes]
        table = pd.DataFrame(rows, columns=None if rows else ["part"])
        silent = markdown_list(self.proposal.silent, "nothing")
        lingering = markdown_list((each.text() for each in self.lingering), "nothing")
        faults = {"what is approved can't be used": self._faults()} if self.approvals.faults else {}
        shown = {"demonstration": f"What is proposed {SHOWN}"} if self._is_shown() else {}
        return {
            "proposal": digest or "none",
            **curator_link("proposals"),
            **faults,
            **shown,
            "changes": len(self.proposal.changes),
            "changes pending": len(self.pending),
            "changes approved": len(self.approvals.changes),
            "changes declined": len(self.declined),
            "how to approve": dg.MetadataValue.md(_how(digest) if self.pending else "nothing waits"),
            "approved, proposed no longer": dg.MetadataValue.md(lingering),
            "proposes nothing": dg.MetadataValue.md(silent),
            "what is proposed": table_of(table, list(table)),
        }

    def _is_shown(self) -> bool:
        return bool(self.proposal.changes) and all(is_demonstration(each) for each in self.proposal.changes)

    def _row(self, change: Change) -> dict[str, Any]:
        return {
            "part": change.section,
            "robot": change.robot,
            "what": change.what,
            "from": change.before,
            "to": change.value,
            "bound": change.bound,
            "approved": change in self.approvals.changes,
            "declined": change in self.declined,
            "rests on": change.counted(),
            "logs": ", ".join(sorted({witness.log for witness in change.witnesses})),
            "simulated": all(witness.simulated for witness in change.witnesses),
            "because": "; ".join(witness.said for witness in change.witnesses),
        }


def _how(digest: str) -> str:
    config = (
        f'{{"ops": {{"approve": {{"config": {{"proposal": "{digest}", "by": "YOUR NAME", "token": "THE TOKEN"}}}}}}}}'
    )
    return (
        f"On the curator's page (`booster-lab curate`), or launch the job `approve_feedback` with the content of "
        f"data/feedback/approval_token (each counts once) in\n\n"
        f'    {config}\n\n(`"sections": ["weights"]` approves a part; other '
        "sections keep what was approved before), or copy data/feedback/proposed.yaml to data/feedback/approved.yaml, "
        "which is then all that is approved."
    )
