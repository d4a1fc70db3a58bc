"""The token of an approval: who can read it has access to the project's files, which the web page gives nobody.

Dagster's webserver takes a launch from any page that a browser on this machine has open. So a job that lets something
take effect asks for what is in `data/feedback/approval_token`. A token counts once: Dagster keeps what a run was
launched with, where its webserver shows it.
"""

import hmac
import secrets

from assets.project import Project
from pipeline.errors import PipelineError
from pipeline.files import atomic

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
