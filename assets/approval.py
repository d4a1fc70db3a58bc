"""Jobs that approve proposed changes or revoke approved ones, and the token that these jobs require.

Dagster's webserver accepts a launch from any page open in a browser on this machine. Therefore these jobs require the
content of `data/feedback/approval_token`, which only a person with access to the project's files can read. A token is
valid once, because Dagster stores and displays the config of each run.
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
    """The launch config does not have the current token of this project."""


def ensure_token(project: Project) -> None:
    """Write a token if there is none."""
    if not project.approval_token.is_file():
        _renew(project)


def use_token(project: Project, token: str) -> None:
    """Check a token and replace the project's token by a new one. Raises TokenError if they differ or none exists."""
    path = project.approval_token
    try:
        expected = path.read_text().strip()
    except (OSError, UnicodeDecodeError):
        expected = ""
    if not expected or not hmac.compare_digest(expected.encode(), token.strip().encode()):
        ensure_token(project)
        raise TokenError(
            f"the token is not the one in {path.relative_to(project.root)}; nothing was changed. Set 'token' to the "
            "content of that file, which shows that you have access to this project. Each token is valid once."
        )
    _renew(project)


def _renew(project: Project) -> None:
    """Write a new token to a file that only its owner can read."""
    atomic.write_bytes(project.approval_token, f"{secrets.token_hex(16)}\n".encode(), mode=OWNER_ALONE)


class Approval(dg.Config):
    """The proposal to approve, and the name of the person who approves it."""

    proposal: str
    """Digest of the reviewed proposal, from the page of curation_feedback. Another proposal is not approved."""
    by: str
    """Name of the person who approves it."""
    token: str
    """Content of data/feedback/approval_token. A token is valid once."""
    policies: list[str] = []  # noqa: RUF012, pydantic copies it
    """Digests of policies: approve only changes whose evidence is from logs of these policies. Empty: all changes."""
    sections: list[str] = []  # noqa: RUF012
    """Sections of the proposal to approve, for example `weights`. Empty: all sections."""


class TakeBackConfig(dg.Config):
    """The approved sections to revoke, and the name of the person who revokes them."""

    sections: list[str]
    """Sections to revoke, for example `weights`."""
    by: str
    """Name of the person who revokes them."""
    token: str
    """Content of data/feedback/approval_token. A token is valid once."""


@dg.op(out={}, description="Write the changes of the proposal with this digest to data/feedback/approved.yaml.")
def approve(context: dg.OpExecutionContext, config: Approval):
    """Approve the changes of a proposal, so that they take effect."""
    with as_failure():
        use_token(PROJECT, config.token)
        policies, sections = tuple(config.policies), tuple(config.sections)
        count = approve_proposal(PROJECT.feedback, config.proposal, config.by, policies=policies, sections=sections)
        context.log.info(f"proposal '{config.proposal}': {count} changes approved by {config.by}")
        note_external(context.instance, PROJECT)


@dg.op(out={}, description="Remove sections from data/feedback/approved.yaml.")
def take_back(context: dg.OpExecutionContext, config: TakeBackConfig):
    """Revoke approved changes, so that they no longer take effect."""
    with as_failure():
        use_token(PROJECT, config.token)
        count = take_back_sections(PROJECT.feedback, tuple(config.sections), config.by)
        context.log.info(f"{', '.join(config.sections)}: {count} changes revoked by {config.by}")
        note_external(context.instance, PROJECT)


@dg.job(
    name="approve_feedback",
    description="Approve the proposal of curation_feedback with the given digest, or some of its sections; other "
    "sections keep their approved changes. A sensor then re-curates the databases.",
)
def approve_feedback() -> None:
    approve()


@dg.job(
    name="take_back_feedback",
    description="Revoke approved sections. A sensor then re-curates the databases without them.",
)
def take_back_feedback() -> None:
    take_back()
