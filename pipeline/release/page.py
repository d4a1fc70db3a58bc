"""The release report as one self-contained HTML page: no scripts, no links, embedded pictures.

All text is escaped. The page contains no time, so equal dossiers give equal bytes; date and name are written by the
person who signs.
"""

import base64
import hashlib
from html import escape
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from pipeline.files import digest
from pipeline.release.dossier import Dossier, Status

KINDS = ("png", "gif")
STYLE = """
body { font: 14px/1.45 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #1c1c1c; }
table { border-collapse: collapse; margin: .6em 0; }
td, th { border: 1px solid #ccc; padding: .25em .6em; text-align: left; vertical-align: top; overflow-wrap: anywhere; }
th { background: #f3f3f3; font-weight: 600; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
table.figures { font-size: 12px; } table.figures tr:nth-child(even) td { background: #fafafa; }
table.figures thead th { position: sticky; top: 0; } caption { text-align: left; font-weight: 600; padding: .2em 0; }
dl { margin: 0; display: grid; grid-template-columns: max-content auto; gap: 0 .8em; } dt { color: #555; }
dd { margin: 0; overflow-wrap: anywhere; }
img { max-width: 100%; } figure { margin: .8em 0; } figcaption { color: #555; }
section { page-break-inside: avoid; } .status { color: #fff; padding: .1em .6em; border-radius: .3em; }
.status.passed { background: #1b7f3b; } .status.failed, .status.failed-to-run { background: #b3261e; }
.status.outdated, .status.not-run { background: #9a6700; }
td.failed { color: #b3261e; font-weight: 600; } td.passed { color: #1b7f3b; }
.signature td { height: 2.6em; min-width: 16em; }
"""


ENVIRONMENT = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined)
ENVIRONMENT.filters["base64"] = lambda data: base64.b64encode(data).decode()


def page(dossier: Dossier) -> str:
    """The page as HTML. Raises ValueError for a picture of an unknown kind."""
    for picture in (*dossier.pictures, *(each for verdict in dossier.verdicts for each in verdict.pictures)):
        if picture.kind not in KINDS:
            raise ValueError(f"a picture is of the kind {picture.kind!r}, there are: {', '.join(KINDS)}")
    counts = {status: sum(each.status is status for each in dossier.verdicts) for status in Status}
    content = ENVIRONMENT.get_template("page.html.jinja").render(
        dossier=dossier,
        summary=", ".join(f"{count} {status.value}" for status, count in counts.items() if count) or "no checks",
        open_points=dossier.open_points,
        failed_to_run=[f"{each.name}: {text}" for each in dossier.verdicts for text in each.failed_to_run],
        not_run=_not_run(dossier),
    )
    signature = _signature(dossier, digest.of_bytes(content.encode()))
    head = f'<meta charset="utf-8"><title>{escape(dossier.title)}</title><style>{STYLE}</style>'
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n{content}\n{signature}\n</body></html>\n'


def style_source() -> str:
    """What a content security policy calls the page's own style sheet."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()}'"


def _not_run(dossier: Dossier) -> tuple[str, ...]:
    whole = [
        f"{each.name}: {'; '.join(each.reasons) or 'no reason is stated'}"
        for each in dossier.verdicts
        if each.status in (Status.NOT_RUN, Status.OUTDATED)
    ]
    parts = [f"{each.name}: {text}" for each in dossier.verdicts for text in each.not_run]
    return (*whole, *parts)


def _signature(dossier: Dossier, content: str) -> str:
    fields = [
        ("Policy (digest of network and gains)", escape(dossier.policy or "none")),
        ("This page (digest of what stands above)", content),
        ("I have read what failed and what was not run", "&#9744; yes"),
        ("Released for", "&#9744; hanging &#9744; on the ground, held &#9744; free"),
        ("Name", ""),
        ("Date", ""),
        ("Signature", ""),
    ]
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{value}</td></tr>" for name, value in fields)
    return f'<h2>Signature</h2><table class="signature">{rows}</table>'
