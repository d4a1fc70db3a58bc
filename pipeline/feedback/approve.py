"""A person's answer to a proposal: approve it or a part of it by its digest, take sections back, or decline it.

The digest ties the answer to what was reviewed. Approved changes are in `data/feedback/approved.yaml`, declined ones in
`declined.yaml` beside it; what was declined is not asked again while its evidence is the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch import Store
from pipeline.errors import PipelineError
from pipeline.feedback.approved import Approvals, added, entries_of, read_approvals, write_entries
from pipeline.feedback.change import SECTIONS, Change, Witness, check_bounds, proposal_digest
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import atomic, settings

PROPOSAL_ASSET = "curation_feedback"
"""The asset whose manifest holds the pending proposal."""


class ApprovalError(PipelineError):
    """An answer to something that is not proposed, or without a name."""


@dataclass(frozen=True, kw_only=True)
class FeedbackFiles:
    """Where a project keeps its proposal and the answers to it."""

    store: Store
    rules_file: Path
    approved: Path
    declined: Path

    @property
    def rules(self) -> FeedbackRules:
        """The rules that bound every change. Raises SettingsError."""
        return settings.read(self.rules_file, FeedbackRules)

    def proposed(self) -> tuple[Change, ...]:
        """The changes of the pending proposal. Raises FileError where none was ever made."""
        return changes_of(self.store.load(PROPOSAL_ASSET).settings)

    def approvals(self) -> Approvals:
        """The approved changes, compared with the rules. What can't be used is reported and raises nothing."""
        return self.answers(self.approved)

    def declined_changes(self) -> tuple[Change, ...]:
        """The changes that a person declined; none where the file can't be read, so that they are asked again."""
        return self.answers(self.declined).changes

    def answers(self, path: Path) -> Approvals:
        """The answers in one of the files."""
        if not path.is_file():
            return Approvals()
        try:
            rules = self.rules
        except PipelineError as error:
            return Approvals(faults=dict.fromkeys(SECTIONS, error))
        return read_approvals(path, rules)


def changes_of(stored: Mapping[str, Any]) -> tuple[Change, ...]:
    """The changes that a manifest's settings hold, in their order."""
    return tuple(
        Change(**{**each, "witnesses": tuple(Witness(**witness) for witness in each["witnesses"])})
        for _, each in sorted(stored.items())
    )


def approve_proposal(
    files: FeedbackFiles, proposal: str, by: str, *, policies: Sequence[str] = (), sections: Sequence[str] = ()
) -> int:
    """Add the changes of a proposal to the approved ones; their number.

    A section is then as this proposal has it; one that is not named, or that the proposal does not contain, stays as
    it was. With `policies` only the same numbers are replaced. Raises ApprovalError if another proposal is pending,
    or none.

    Args:
        proposal: digest of the proposal that was reviewed
        by: name of the person
        policies: digests; only changes that rest on logs of these alone are approved; empty: all
        sections: parts that are approved, such as `weights`; empty: all
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
        entries = added(earlier.entries, entries_of(kept, proposal, by), whole=not policies)
        check_bounds([each for entry in entries if entry.section in touched for each in entry.changes], rules)
        write_entries(files.approved, entries)
    return len(kept)


def decline_proposal(files: FeedbackFiles, proposal: str, by: str, *, sections: Sequence[str] = ()) -> int:
    """Note the changes of a proposal as declined; their number. Approved changes stay approved. Raises ApprovalError.

    Args: as for `approve_proposal`
    """
    kept = _answered(files, proposal, by, (), sections)
    with atomic.only_writer(files.declined):
        earlier = files.answers(files.declined)
        if not earlier.readable:
            fault = next(iter(earlier.faults.values()))
            raise ApprovalError(f"nothing was declined, since what was declined before can't be read: {fault}")
        entries = added(earlier.entries, entries_of(kept, proposal, by), whole=True)
        write_entries(files.declined, entries, head="declined")
    return len(kept)


def take_back_sections(files: FeedbackFiles, sections: Sequence[str], by: str) -> int:
    """Remove sections from the approved changes; how many changes these were. Raises ApprovalError."""
    if not by.strip():
        raise ApprovalError("taking back needs a name: state who does it in 'by'.")
    with atomic.only_writer(files.approved):
        return _take_back(files, sections)


def _take_back(files: FeedbackFiles, sections: Sequence[str]) -> int:
    approvals = files.approvals()
    if not approvals.readable:
        raise ApprovalError(f"nothing was taken back: {next(iter(approvals.faults.values()))}")
    there = sorted({entry.section for entry in approvals.entries})
    strange = [section for section in sections if section not in there]
    if strange or not sections:
        asked = f"nothing of '{strange[0]}' is approved" if strange else "no section is named"
        raise ApprovalError(f"{asked}; approved are: {', '.join(there) or 'none'}.")
    gone = [entry for entry in approvals.entries if entry.section in sections]
    write_entries(files.approved, [entry for entry in approvals.entries if entry not in gone])
    return sum(len(entry.changes) for entry in gone)


def _answered(
    files: FeedbackFiles, proposal: str, by: str, policies: Sequence[str], sections: Sequence[str]
) -> list[Change]:
    """The changes that an answer is about. Raises ApprovalError."""
    changes = files.proposed()
    pending = proposal_digest(changes)
    if not pending or proposal != pending:
        raise ApprovalError(
            f"proposal '{proposal}' is not pending; the page of curation_feedback shows '{pending or 'none'}'."
        )
    if not by.strip():
        raise ApprovalError("an approval needs a name: state who approves it in 'by'.")
    strange = [section for section in sections if section not in SECTIONS]
    if strange:
        raise ApprovalError(
            f"there is no section '{strange[0]}'; there are: {', '.join(SECTIONS)}. Nothing was answered."
        )
    kept = [each for each in changes if not policies or all(one.policy in policies for one in each.witnesses)]
    kept = [each for each in kept if not sections or each.section in sections]
    if not kept:
        asked = ", ".join((*policies, *sections))
        raise ApprovalError(f"no change of proposal '{proposal}' is of {asked} alone; nothing was approved.")
    return kept
