"""The release report as one HTML page without scripts or links, all text escaped; equal dossiers give equal bytes."""

import base64
import hashlib
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pipeline.files import digest
from pipeline.release.dossier import Dossier, Status

KINDS = ("png", "gif")
FOLDER = Path(__file__).parent
STYLE = (FOLDER / "page.css").read_text(encoding="utf-8")
ENVIRONMENT = Environment(loader=FileSystemLoader(FOLDER), autoescape=True, undefined=StrictUndefined)
ENVIRONMENT.filters["base64"] = lambda data: base64.b64encode(data).decode()


def page(dossier: Dossier) -> str:
    """The page as HTML. Raises ValueError for a picture of an unknown kind."""
    for picture in (*dossier.pictures, *(each for verdict in dossier.verdicts for each in verdict.pictures)):
        if picture.kind not in KINDS:
            raise ValueError(f"a picture has the kind {picture.kind!r}; kinds are: {', '.join(KINDS)}")
    counts = {status: sum(each.status is status for each in dossier.verdicts) for status in Status}
    content = ENVIRONMENT.get_template("page.html.jinja").render(
        dossier=dossier,
        summary=", ".join(f"{count} {status.value}" for status, count in counts.items() if count) or "no checks",
        open_points=dossier.open_points,
        failed_to_run=[f"{each.name}: {text}" for each in dossier.verdicts for text in each.failed_to_run],
        not_run=_not_run(dossier),
    )
    signed = digest.of_bytes(content.encode())
    template = ENVIRONMENT.get_template("signed.html.jinja")
    return template.render(dossier=dossier, content=Markup(content), signed=signed, style=Markup(STYLE))


def style_source() -> str:
    """Hash of the embedded style sheet, as a source in a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()}'"


def _not_run(dossier: Dossier) -> tuple[str, ...]:
    whole = [
        f"{each.name}: {'; '.join(each.reasons) or 'no reason is stated'}"
        for each in dossier.verdicts
        if each.status in (Status.NOT_RUN, Status.OUTDATED)
    ]
    parts = [f"{each.name}: {text}" for each in dossier.verdicts for text in each.not_run]
    return (*whole, *parts)
