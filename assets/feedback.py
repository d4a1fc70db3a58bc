"""Feedback from hardware: changes proposed from failures, and the comparison of each trial with its simulation.

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
from pipeline.feedback.change import Change, change_key, proposal_digest
from pipeline.feedback.propose import Proposal, propose
from pipeline.feedback.rules import FeedbackRules
from pipeline.feedback.trust import is_demonstration
from pipeline.files import atomic, settings
from pipeline.files.shown_text import markdown_list
from pipeline.project import PROJECT
from pipeline.selection import Curation

DEMONSTRATION_ONLY = (
    "is based only on the logs in data/hardware_logs/demo, which ship to demonstrate the loop: approve it to try the "
    "loop, or ignore it. It disappears with the first log of your own that counts, and never takes effect without "
    "approval."
)


@dataclass(frozen=True, kw_only=True)
class FeedbackPage:
    """A proposal and the answers to it."""

    proposal: Proposal
    approvals: Approvals
    declined_changes: Sequence[Change] = ()
    """Every declined change, including those that are no longer proposed."""

    @property
    def declined(self) -> list[Change]:
        """Proposed changes that are declined and not approved."""
        known, approved = self.declined_changes, self.approvals.changes
        return [each for each in self.proposal.changes if each in known and each not in approved]

    @property
    def pending(self) -> list[Change]:
        """Proposed changes without an answer, including those that are approved with another value."""
        answered = (*self.approvals.changes, *self.declined)
        return [each for each in self.proposal.changes if each not in answered]

    @property
    def nothing_waits(self) -> bool:
        """Whether no person has to act. Changes based only on the demonstration logs can wait."""
        return not self.approvals.faults and all(is_demonstration(each) for each in self.pending)

    def sentence(self) -> str:
        """One line on what waits for an answer."""
        if self.approvals.faults:
            return self._faults()
        if not self.pending:
            return NOTHING
        if self.nothing_waits:
            count = len(self.pending)
            return f"no change from your own logs is pending; the proposal ({count} changes) {DEMONSTRATION_ONLY}"
        return f"{len(self.pending)} changes wait for approval"

    def _faults(self) -> str:
        faults = dict.fromkeys(str(fault) for fault in self.approvals.faults.values())
        return " ".join(faults)

    def metadata(self, digest: str) -> dict[str, Any]:
        """The rows of the asset's page."""
        unproposed = markdown_list(self.proposal.unproposed, "nothing")
        proposed = {change_key(each) for each in self.proposal.changes}
        left = (each.text() for each in self.approvals.changes if change_key(each) not in proposed)
        faults = {"invalid approved changes": self._faults()} if self.approvals.faults else {}
        changes = self.proposal.changes
        shown = (
            {"demonstration": f"The proposal {DEMONSTRATION_ONLY}"}
            if changes and all(map(is_demonstration, changes))
            else {}
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
            "how to approve": dg.MetadataValue.md(_how_to_approve(digest) if self.pending else NOTHING),
            "approved, no longer proposed": dg.MetadataValue.md(markdown_list(left, "nothing")),
            "logs and failures without a proposal": dg.MetadataValue.md(unproposed),
            "proposed changes": table_of([self._row(each) for each in self.proposal.changes]),
        }

    def _row(self, change: Change) -> dict[str, Any]:
        return {
            "section": change.section,
            "robot": change.robot,
            "item": change.what,
            "from": change.before,
            "to": change.value,
            "bound": change.bound,
            "approved": change in self.approvals.changes,
            "declined": change in self.declined,
            "evidence": change.counted(),
            "logs": ", ".join(sorted({witness.log for witness in change.witnesses})),
            "simulated": all(witness.simulated for witness in change.witnesses),
            "failures": "; ".join(witness.said for witness in change.witnesses),
        }


def _how_to_approve(digest: str) -> str:
    config = (
        f'{{"ops": {{"approve": {{"config": {{"proposal": "{digest}", "by": "YOUR NAME", "token": "THE TOKEN"}}}}}}}}'
    )
    return (
        f"There are three ways. Use the curator's page (`booster-lab curate`). Or launch the job `approve_feedback` "
        f"with this config, in which the token is the content of data/feedback/approval_token (valid once):\n\n"
        f'    {config}\n\nAdd `"sections": ["weights"]` to approve some sections only; other sections keep their '
        "approved changes. Or copy data/feedback/proposed.yaml to data/feedback/approved.yaml, which replaces all "
        "approved changes."
    )


FAILURES, FEEDBACK, REPORT = FIELD
NOTHING = "nothing waits for approval"
NOTHING_PENDING = "nothing_pending"


@asset_of(FEEDBACK, "python", checks={NOTHING_PENDING: "No proposed change waits for a person's answer."})
def curation_feedback(context: dg.AssetExecutionContext, failure_modes: Manifest):
    """Bounded changes proposed from the failures by data/feedback_rules.yaml, each with the logs that support it.

    A change takes effect when it is approved: on the curator's page, by the job approve_feedback with the digest of
    this proposal, or by copying data/feedback/proposed.yaml to approved.yaml. The job take_back_feedback revokes
    approved sections.
    """
    rules = PROJECT.read("feedback_rules.yaml", FeedbackRules)
    commands = PROJECT.read("commands.yaml", CommandSettings)
    bounds = PROJECT.read("curation.yaml", Curation).windows.bounds
    proposal = propose(reports_of(failure_modes), rules, commands, bounds)
    found = proposal_digest(proposal.changes)
    write_entries(PROJECT.proposed_feedback, entries_of(proposal.changes, found), head="proposed")
    if not rules.approval.required:
        _approve_automatically(proposal.changes, found)
    made = {f"{place:04d}": settings.plain(each) for place, each in enumerate(proposal.changes)}
    ensure_token(PROJECT)
    approvals = PROJECT.feedback.approvals()
    declined = PROJECT.feedback.declined_changes()
    page = FeedbackPage(proposal=proposal, approvals=approvals, declined_changes=declined)
    check = check_result(FEEDBACK, NOTHING_PENDING, page.nothing_waits, page.sentence())
    context.log.info(f"proposal '{found or 'none'}': {len(proposal.changes)} changes; {page.sentence()}")
    shown = {PAGE_TAG: shown_state(approvals, declined)}
    return result_of(FEEDBACK, made, page.metadata(found), [check], tags=shown)


def _approve_automatically(changes: Sequence[Any], proposal: str) -> None:
    """Write the proposal as the approved changes; changes based only on demonstration logs still need a person."""
    path = PROJECT.feedback.approved
    with atomic.only_writer(path):
        approved = PROJECT.feedback.approvals().changes
        kept = [each for each in changes if not is_demonstration(each) or each in approved]
        write_entries(path, entries_of(kept, proposal, "the rules, which require no approval"))


@asset_of(REPORT, "mujoco")
def sim_to_real_report(failure_modes: Manifest):
    """Sim-to-real comparison: each trial and MuJoCo with the same policy, gains and commands.

    Compares achieved velocities [m/s, rad/s] and the limit cycles of hip pitch and knee.
    """
    rows, notes = [], []
    for name, each in sorted(failure_modes.settings.items()):
        twin = each.get("twin")
        if twin is None:
            notes.append(f"{name}: its policy is not available, or it has no steady stretch")
            continue
        rows.append(_twin_row(name, twin))
        notes += [f"{name}: {note}" for note in twin["notes"]]
    metadata = {
        "trials compared": len(rows),
        "not compared": dg.MetadataValue.md(markdown_list(notes, "nothing")),
        "dagster/row_count": len(rows),
        "trials and their simulation": table_of(rows),
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
