"""The jobs by which a person lets proposed changes take effect, or takes them back."""

import dagster as dg

from assets.approval_token import use_token
from assets.approved import approvals_of
from assets.external import note_external
from assets.plainly import told_plainly
from assets.plan import FIELD
from assets.project import PROJECT, Project
from pipeline.errors import PipelineError
from pipeline.files import settings


class Approval(dg.Config):
    """Who approves which proposal."""

    proposal: str
    """Digest of the proposal, from the page of curation_feedback: what was looked at is what is approved."""
    by: str
    """Who approves it."""
    token: str
    """Content of data/feedback/approval_token, which counts once."""
    policies: list[str] = []  # noqa: RUF012, pydantic copies it
    """Digests of policies: only changes that rest on logs of these alone are approved. Empty: all."""
    sections: list[str] = []  # noqa: RUF012
    """Parts of the proposal that are approved, as `weights`. Empty: all."""


class TakingBack(dg.Config):
    """Who takes which approved sections back."""

    sections: list[str]
    """Parts that are taken back, as `weights`."""
    by: str
    """Who takes them back."""
    token: str
    """Content of data/feedback/approval_token, which counts once."""


class ApprovalError(PipelineError):
    """An approval of something that is not proposed."""


@dg.op(out={}, description="Add the proposal of that digest, or a part of it, to data/feedback/approved.yaml.")
def approve(context: dg.OpExecutionContext, config: Approval):
    """Let the changes of a proposal take effect."""
    with told_plainly():
        use_token(PROJECT, config.token)
        policies, sections = tuple(config.policies), tuple(config.sections)
        count = approve_proposal(PROJECT, config.proposal, config.by, policies=policies, sections=sections)
        context.log.info(f"proposal '{config.proposal}': {count} changes approved by {config.by}")
        note_external(context.instance, PROJECT)


@dg.op(out={}, description="Take sections out of data/feedback/approved.yaml.")
def take_back(context: dg.OpExecutionContext, config: TakingBack):
    """Let approved changes take no effect any longer."""
    with told_plainly():
        use_token(PROJECT, config.token)
        count = take_back_sections(PROJECT, tuple(config.sections), config.by)
        context.log.info(f"{', '.join(config.sections)}: {count} changes taken back by {config.by}")
        note_external(context.instance, PROJECT)


@dg.job(
    name="approve_feedback",
    description="Approve the pending proposal of curation_feedback by its digest, or sections of it; other sections "
    "keep what was approved before. The databases are re-curated then.",
)
def approve_feedback() -> None:
    approve()


@dg.job(
    name="take_back_feedback",
    description="Take approved sections back; the databases are re-curated without them.",
)
def take_back_feedback() -> None:
    take_back()


def approve_proposal(
    project: Project, proposal: str, by: str, *, policies: tuple[str, ...] = (), sections: tuple[str, ...] = ()
) -> int:
    """Add the changes of a proposal to what is approved; their number.

    A section is then as this proposal has it; one that is not asked for, or that the proposal has nothing of, stays as
    it was. With `policies` only the same numbers give way. Raises ApprovalError where another proposal is pending, or
    none.
    """
    from pipeline.feedback.approved import added, entries_of, write_entries
    from pipeline.feedback.change import Change, Witness, check_bounds, proposal_digest
    from pipeline.feedback.rules import FeedbackRules

    stored = project.store.load(FIELD[1].key.to_user_string()).settings
    changes = tuple(
        Change(**{**each, "witnesses": tuple(Witness(**witness) for witness in each["witnesses"])})
        for _, each in sorted(stored.items())
    )
    pending = proposal_digest(changes)
    if not pending or proposal != pending:
        raise ApprovalError(
            f"proposal '{proposal}' is not pending; the page of curation_feedback shows '{pending or 'none'}'."
        )
    if not by.strip():
        raise ApprovalError("an approval needs a name: state who approves it in 'by'.")
    kept = [each for each in changes if not policies or all(one.policy in policies for one in each.witnesses)]
    kept = [each for each in kept if not sections or each.section in sections]
    if not kept:
        asked = ", ".join((*policies, *sections))
        raise ApprovalError(f"no change of proposal '{proposal}' is of {asked} alone; nothing was approved.")
    rules = settings.read(project.settings("feedback_rules.yaml"), FeedbackRules)
    check_bounds(kept, rules)
    earlier = approvals_of(project)
    touched = {each.section for each in kept}
    for section, fault in earlier.faults.items():
        if not earlier.readable or (policies and section in touched):
            raise ApprovalError(
                f"nothing was approved, since the approved changes of '{section}' can't be read: {fault}"
            )
    entries = added(earlier.entries, entries_of(kept, proposal, by), whole=not policies)
    check_bounds([each for entry in entries if entry.section in touched for each in entry.changes], rules)
    write_entries(project.approved_feedback, entries)
    return len(kept)


def take_back_sections(project: Project, sections: tuple[str, ...], by: str) -> int:
    """Take sections out of what is approved; how many changes these were. Raises ApprovalError."""
    from pipeline.feedback.approved import write_entries

    approvals = approvals_of(project)
    if not approvals.readable:
        raise ApprovalError(f"nothing was taken back: {next(iter(approvals.faults.values()))}")
    if not by.strip():
        raise ApprovalError("taking back needs a name: state who does it in 'by'.")
    there = sorted({entry.section for entry in approvals.entries})
    strange = [section for section in sections if section not in there]
    if strange or not sections:
        asked = f"nothing of '{strange[0]}' is approved" if strange else "no section is named"
        raise ApprovalError(f"{asked}; approved are: {', '.join(there) or 'none'}.")
    gone = [entry for entry in approvals.entries if entry.section in sections]
    write_entries(project.approved_feedback, [entry for entry in approvals.entries if entry not in gone])
    return sum(len(entry.changes) for entry in gone)
