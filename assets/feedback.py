"""What hardware teaches: the changes that failures ask for, and each trial beside its simulation.

hardware_trials → failure_modes → curation_feedback ⇢ a person approves ⇢ approved_* → KP1, KP4, KP5, motors, training
                       └→ sim_to_real_report
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import dagster as dg

from assets.approval import ensure_token
from assets.approved import PAGE_TAG, shown_state
from assets.failure_modes import reports_of
from assets.plan import FIELD
from assets.report import asset_of, check_result, curator_link, result_of, table_of
from pipeline.batch import Manifest
from pipeline.feasibility import CommandSettings
from pipeline.feedback.approved import Approvals, entries_of, write_entries
from pipeline.feedback.change import Change, place_of, proposal_digest
from pipeline.feedback.propose import Proposal, propose
from pipeline.feedback.rules import FeedbackRules
from pipeline.feedback.trust import is_demonstration
from pipeline.files import atomic, settings
from pipeline.files.shown_text import markdown_list
from pipeline.project import PROJECT
from pipeline.selection import Curation

SHOWN = (
    "rests on the logs of data/hardware_logs/demo alone, which ship to show the loop: approve it to try the loop, or "
    "leave it. It gives way to the first log of your own that counts, and never takes effect without a person."
)


@dataclass(frozen=True, kw_only=True)
class FeedbackPage:
    """A proposal beside a person's answers."""

    proposal: Proposal
    approvals: Approvals
    declined_changes: Sequence[Change] = ()
    """Every change that a person declined, proposed now or not."""

    @property
    def declined(self) -> list[Change]:
        """The proposed changes that a person declined and has not approved since."""
        known, approved = self.declined_changes, self.approvals.changes
        return [each for each in self.proposal.changes if each in known and each not in approved]

    @property
    def pending(self) -> list[Change]:
        """What is proposed and not answered; also a number that is approved with another value."""
        answered = (*self.approvals.changes, *self.declined)
        return [each for each in self.proposal.changes if each not in answered]

    @property
    def nothing_waits(self) -> bool:
        """Whether no person has to act. A change of the demonstration logs alone can wait."""
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
        silent = markdown_list(self.proposal.silent, "nothing")
        places = {place_of(each) for each in self.proposal.changes}
        left = (each.text() for each in self.approvals.changes if place_of(each) not in places)
        faults = {"what is approved can't be used": self._faults()} if self.approvals.faults else {}
        changes = self.proposal.changes
        shown = (
            {"demonstration": f"What is proposed {SHOWN}"} if changes and all(map(is_demonstration, changes)) else {}
        )
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
            "approved, proposed no longer": dg.MetadataValue.md(markdown_list(left, "nothing")),
            "proposes nothing": dg.MetadataValue.md(silent),
            "what is proposed": table_of([self._row(each) for each in self.proposal.changes]),
        }

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


FAILURES, FEEDBACK, REPORT = FIELD
NOTHING_PENDING = "nothing_pending"


@asset_of(FEEDBACK, "python", checks={NOTHING_PENDING: "What the rules propose is what a person approved."})
def curation_feedback(context: dg.AssetExecutionContext, failure_modes: Manifest):
    """Changes that the failures ask for, by data/feedback_rules.yaml: each bounded, with the logs that it rests on.

    They take effect when they are approved: by the job approve_feedback with this page's proposal, or by copying
    data/feedback/proposed.yaml to approved.yaml; the job take_back_feedback takes sections back.
    """
    rules = PROJECT.read("feedback_rules.yaml", FeedbackRules)
    commands = PROJECT.read("commands.yaml", CommandSettings)
    bounds = PROJECT.read("curation.yaml", Curation).windows.bounds
    proposal = propose(reports_of(failure_modes), rules, commands, bounds)
    found = proposal_digest(proposal.changes)
    write_entries(PROJECT.proposed_feedback, entries_of(proposal.changes, found), head="proposed")
    if not rules.approval.required:
        _let_take_effect(proposal.changes, found)
    made = {f"{place:04d}": settings.plain(each) for place, each in enumerate(proposal.changes)}
    ensure_token(PROJECT)
    approvals = PROJECT.feedback.approvals()
    declined = PROJECT.feedback.declined_changes()
    page = FeedbackPage(proposal=proposal, approvals=approvals, declined_changes=declined)
    check = check_result(FEEDBACK, NOTHING_PENDING, page.nothing_waits, page.sentence())
    context.log.info(f"proposal '{found or 'none'}': {len(proposal.changes)} changes; {page.sentence()}")
    shown = {PAGE_TAG: shown_state(approvals, declined)}
    return result_of(FEEDBACK, made, page.metadata(found), [check], tags=shown)


def _let_take_effect(changes: Sequence[Any], proposal: str) -> None:
    """What is proposed is what is approved, no more and no less; what only shows the loop waits for a person."""
    path = PROJECT.feedback.approved
    with atomic.only_writer(path):
        approved = PROJECT.feedback.approvals().changes
        kept = [each for each in changes if not is_demonstration(each) or each in approved]
        write_entries(path, entries_of(kept, proposal, "the rules, which ask for no approval"))


@asset_of(REPORT, "mujoco")
def sim_to_real_report(failure_modes: Manifest):
    """Each trial beside MuJoCo with the same policy, gains and command: tracking, and the limit cycles of the legs."""
    rows, notes = [], []
    for name, each in sorted(failure_modes.settings.items()):
        twin = each.get("twin")
        if twin is None:
            notes.append(f"{name}: its policy is not at hand, or nothing in it is steady")
            continue
        rows.append(_twin_row(name, twin))
        notes += [f"{name}: {note}" for note in twin["notes"]]
    metadata = {
        "trials compared": len(rows),
        "not compared": dg.MetadataValue.md(markdown_list(notes, "nothing")),
        "dagster/row_count": len(rows),
        "trials against their simulation": table_of(rows),
    }
    return result_of(REPORT, {row["trial"]: row for row in rows}, metadata)


def _twin_row(name: str, twin: dict[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {"trial": name, "from [s]": twin["start_s"], "to [s]": twin["stop_s"]}
    for place, (axis, unit) in enumerate((("forward", "m/s"), ("lateral", "m/s"), ("yaw", "rad/s"))):
        row |= {
            f"{axis} commanded [{unit}]": twin["command"][place],
            f"{axis} achieved [{unit}]": twin["achieved"][place],
            f"{axis} simulated [{unit}]": twin["simulated"][place],
        }
    row["simulation fell"] = twin["simulation_fell"]
    for each in twin["cycles"]:
        side = each["name"].split()[-1]
        row |= {f"{side} shape distance, {plane}": value for plane, value in each["shape_distance"].items()}
        row |= {
            f"{side} period ratio": each["period_ratio"],
            f"{side} knee amplitude ratio": each["knee_amplitude_ratio"],
        }
    return row
