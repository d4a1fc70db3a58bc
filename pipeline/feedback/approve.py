"""A person's answer to a proposal: approve it or some sections, decline it, or revoke approved sections.

An answer names the digest of the reviewed proposal. Approved changes are in `data/feedback/approved.yaml`, declined
ones in `declined.yaml` beside it. A declined change is not pending again as long as its evidence is the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch import Store
from pipeline.errors import PipelineError
from pipeline.feedback.approved import Approvals, entries_of, merged, read_approvals, write_entries
from pipeline.feedback.change import SECTIONS, Change, Witness, check_bounds, proposal_digest
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import atomic, settings

PROPOSAL_ASSET = "curation_feedback"
"""The asset whose manifest holds the pending proposal."""


class ApprovalError(PipelineError):
    """The answer names no pending change, or no person."""


@dataclass(frozen=True, kw_only=True)
class FeedbackFiles:
    """Files of a project with its proposal and the answers to it."""

    store: Store
    rules_file: Path
    approved: Path
    declined: Path

    @property
    def rules(self) -> FeedbackRules:
        """The rules that bound every change. Raises SettingsError."""
        return settings.read(self.rules_file, FeedbackRules)

    def proposed(self) -> tuple[Change, ...]:
        """The changes of the pending proposal. Raises FileError if there is no proposal yet."""
        return changes_of(self.store.load(PROPOSAL_ASSET).settings)

    def approvals(self) -> Approvals:
        """The approved changes, checked against the rules. Invalid sections are reported as faults, not raised."""
        return self.answers(self.approved)

    def declined_changes(self) -> tuple[Change, ...]:
        """The declined changes; none if the file is unreadable, so that they are pending again."""
        return self.answers(self.declined).changes

    def answers(self, path: Path) -> Approvals:
        """The answers in `approved` or `declined`."""
        if not path.is_file():
            return Approvals()
        try:
            rules = self.rules
        except PipelineError as error:
            return Approvals(faults=dict.fromkeys(SECTIONS, error))
        return read_approvals(path, rules)


def changes_of(stored: Mapping[str, Any]) -> tuple[Change, ...]:
    """The changes in the settings of a manifest, in their order."""
    return tuple(
        Change(**{**each, "witnesses": tuple(Witness(**witness) for witness in each["witnesses"])})
        for _, each in sorted(stored.items())
    )


def approve_proposal(
    files: FeedbackFiles, proposal: str, by: str, *, policies: Sequence[str] = (), sections: Sequence[str] = ()
) -> int:
    """Approve changes of a proposal and return their number.

    The proposal replaces each approved section that it contains; other sections stay as they are. With `policies`, it
    replaces single changes instead of sections. Raises ApprovalError if this proposal is not pending.

    Args:
        files: files of the project
        proposal: digest of the reviewed proposal
        by: name of the person
        policies: digests of policies: approve only changes whose evidence is from logs of these; empty: all changes
        sections: sections to approve, for example `weights`; empty: all
    """
    kept = _answered(files, proposal, by, policies, sections)
    rules = files.rules
    check_bounds(kept, rules)
    touched = {each.section for each in kept}
    with atomic.only_writer(files.approved):
        earlier = files.approvals()
        for section, fault in earlier.faults.items():
            if not earlier.readable or (policies and section in touched):
                raise ApprovalError(
                    f"nothing was approved, since the approved changes of '{section}' can't be read: {fault}"
                )
        entries = merged(earlier.entries, entries_of(kept, proposal, by), whole=not policies)
        check_bounds([each for entry in entries if entry.section in touched for each in entry.changes], rules)
        write_entries(files.approved, entries)
    return len(kept)


def decline_proposal(files: FeedbackFiles, proposal: str, by: str, *, sections: Sequence[str] = ()) -> int:
    """Decline changes of a proposal and return their number. Approved changes stay approved. Raises ApprovalError.

    The arguments are those of `approve_proposal`.
    """
    kept = _answered(files, proposal, by, (), sections)
    with atomic.only_writer(files.declined):
        earlier = files.answers(files.declined)
        if not earlier.readable:
            fault = next(iter(earlier.faults.values()))
            raise ApprovalError(f"nothing was declined, since what was declined before can't be read: {fault}")
        entries = merged(earlier.entries, entries_of(kept, proposal, by), whole=True)
        write_entries(files.declined, entries, head="declined")
    return len(kept)


def take_back_sections(files: FeedbackFiles, sections: Sequence[str], by: str) -> int:
    """Revoke approved sections and return the number of their changes. Raises ApprovalError."""
    if not by.strip():
        raise ApprovalError("taking back needs a name: state who does it in 'by'.")
    with atomic.only_writer(files.approved):
        return _take_back(files, sections)


def _take_back(files: FeedbackFiles, sections: Sequence[str]) -> int:
    approvals = files.approvals()
    if not approvals.readable:
        raise ApprovalError(f"nothing was taken back: {next(iter(approvals.faults.values()))}")
    approved = sorted({entry.section for entry in approvals.entries})
    unknown = [section for section in sections if section not in approved]
    if unknown or not sections:
        named = f"nothing of '{unknown[0]}' is approved" if unknown else "no section is named"
        raise ApprovalError(f"{named}; approved are: {', '.join(approved) or 'none'}.")
    revoked = [entry for entry in approvals.entries if entry.section in sections]
    write_entries(files.approved, [entry for entry in approvals.entries if entry not in revoked])
    return sum(len(entry.changes) for entry in revoked)


def _answered(
    files: FeedbackFiles, proposal: str, by: str, policies: Sequence[str], sections: Sequence[str]
) -> list[Change]:
    """The changes that an answer refers to. Raises ApprovalError."""
    changes = files.proposed()
    pending = proposal_digest(changes)
    if not pending or proposal != pending:
        raise ApprovalError(
            f"proposal '{proposal}' is not pending; the page of curation_feedback shows '{pending or 'none'}'."
        )
    if not by.strip():
        raise ApprovalError("an approval needs a name: state who approves it in 'by'.")
    unknown = [section for section in sections if section not in SECTIONS]
    if unknown:
        raise ApprovalError(
            f"there is no section '{unknown[0]}'; sections are: {', '.join(SECTIONS)}. Nothing was answered."
        )
    kept = [each for each in changes if not policies or all(one.policy in policies for one in each.witnesses)]
    kept = [each for each in kept if not sections or each.section in sections]
    if not kept:
        named = ", ".join((*policies, *sections))
        raise ApprovalError(f"no change of proposal '{proposal}' belongs only to {named}; nothing was approved.")
    return kept
