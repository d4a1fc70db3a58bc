"""The jobs by which a person lets proposed changes take effect, or takes them back, and the token that they require.

Dagster's webserver takes a launch from any page that a browser on this machine has open. So a job that lets something
take effect asks for what is in `data/feedback/approval_token`, which only a person with access to the project's files
can read. A token counts once: Dagster keeps what a run was launched with, where its webserver shows it.
"""

import hmac
import secrets

import dagster as dg

from assets.bootstrap import note_external
from assets.report import as_failure
from pipeline.errors import PipelineError
from pipeline.feedback.approve import approve_proposal, take_back_sections
from pipeline.files import atomic
from pipeline.project import PROJECT, Project

OWNER_ALONE = 0o600


class TokenError(PipelineError):
    """A launch without the token of this project."""


def ensure_token(project: Project) -> None:
    """Write a token where there is none."""
    if not project.approval_token.is_file():
        _renew(project)


def use_token(project: Project, token: str) -> None:
    """Take the project's token, which a new one replaces. Raises TokenError where it is another one, or none yet."""
    path = project.approval_token
    try:
        expected = path.read_text().strip()
    except (OSError, UnicodeDecodeError):
        expected = ""
    if not expected or not hmac.compare_digest(expected.encode(), token.strip().encode()):
        ensure_token(project)
        raise TokenError(
            f"the token is not the one in {path.relative_to(project.root)}; nothing was changed. State the content of "
            "that file as 'token': it shows that you may write in this project. Each one counts once."
        )
    _renew(project)


def _renew(project: Project) -> None:
    """A new token, which only the file's owner may read."""
    atomic.write_bytes(project.approval_token, f"{secrets.token_hex(16)}\n".encode(), mode=OWNER_ALONE)


class Approval(dg.Config):
    """Who approves which proposal."""

    proposal: str
    """Digest of the proposal, from the page of curation_feedback: what was reviewed is what is approved."""
    by: str
    """Who approves it."""
    token: str
    """Content of data/feedback/approval_token, which counts once."""
    policies: list[str] = []  # noqa: RUF012, pydantic copies it
    """Digests of policies: only changes that rest on logs of these alone are approved. Empty: all."""
    sections: list[str] = []  # noqa: RUF012
    """Parts of the proposal that are approved, as `weights`. Empty: all."""


class TakeBackConfig(dg.Config):
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
    with as_failure():
        use_token(PROJECT, config.token)
        policies, sections = tuple(config.policies), tuple(config.sections)
        count = approve_proposal(PROJECT.feedback, config.proposal, config.by, policies=policies, sections=sections)
        context.log.info(f"proposal '{config.proposal}': {count} changes approved by {config.by}")
        note_external(context.instance, PROJECT)


@dg.op(out={}, description="Take sections out of data/feedback/approved.yaml.")
def take_back(context: dg.OpExecutionContext, config: TakeBackConfig):
    """Let approved changes take no effect any longer."""
    with as_failure():
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
