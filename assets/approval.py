"""The jobs by which a person lets proposed changes take effect, or takes them back."""

import dagster as dg

from assets.approval_token import use_token
from assets.external import note_external
from assets.plainly import told_plainly
from assets.project import PROJECT
from pipeline.feedback.approve import approve_proposal, take_back_sections


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


@dg.op(out={}, description="Add the proposal of that digest, or a part of it, to data/feedback/approved.yaml.")
def approve(context: dg.OpExecutionContext, config: Approval):
    """Let the changes of a proposal take effect."""
    with told_plainly():
        use_token(PROJECT, config.token)
        policies, sections = tuple(config.policies), tuple(config.sections)
        count = approve_proposal(PROJECT.feedback, config.proposal, config.by, policies=policies, sections=sections)
        context.log.info(f"proposal '{config.proposal}': {count} changes approved by {config.by}")
        note_external(context.instance, PROJECT)


@dg.op(out={}, description="Take sections out of data/feedback/approved.yaml.")
def take_back(context: dg.OpExecutionContext, config: TakingBack):
    """Let approved changes take no effect any longer."""
    with told_plainly():
        use_token(PROJECT, config.token)
        count = take_back_sections(PROJECT.feedback, tuple(config.sections), config.by)
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
