"""The release report as one self-contained HTML page: no scripts, no links, embedded pictures.

All text is escaped. The page contains no time, so equal dossiers give equal bytes; date and name are written by the
person who signs.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape

from pipeline.files import digest
from pipeline.release.dossier import Dossier, Picture, Status, Verdict

COLOURS = {
    Status.PASSED: "#1b7f3b",
    Status.FAILED: "#b3261e",
    Status.OUTDATED: "#9a6700",
    Status.FAILED_TO_RUN: "#b3261e",
    Status.NOT_RUN: "#9a6700",
}
KINDS = ("png", "gif")
STYLE = """
body { font: 14px/1.45 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #1c1c1c; }
table { border-collapse: collapse; margin: .6em 0; }
td, th { border: 1px solid #ccc; padding: .25em .6em; text-align: left; vertical-align: top; overflow-wrap: anywhere; }
th { background: #f3f3f3; font-weight: 600; }
img { max-width: 100%; } figure { margin: .8em 0; } figcaption { color: #555; }
section { page-break-inside: avoid; } .status { color: #fff; padding: .1em .6em; border-radius: .3em; }
.signature td { height: 2.6em; min-width: 16em; }
"""


def page(dossier: Dossier) -> str:
    """The page as HTML. Raises ValueError for a picture of an unknown kind."""
    body = [
        f"<h1>{escape(dossier.title)}</h1>",
        _summary(dossier),
        _section("Policy", _pairs(dossier.card)),
        _section("Conditions of use", _list(dossier.conditions)),
        _section("Where its data comes from", _table(("asset", "version", "what it says"), dossier.lineage)),
        "<h2>Verdicts</h2>",
        *(_verdict(each) for each in dossier.verdicts),
        _section("Pictures", "".join(map(_figure, dossier.pictures)) or "<p>None.</p>"),
        _section("What failed to run", _list(_failed_to_run(dossier))),
        _section("What was not run", _list(_not_run(dossier))),
    ]
    content = "\n".join(body)
    signature = _signature(dossier, digest.of_bytes(content.encode()))
    head = f'<meta charset="utf-8"><title>{escape(dossier.title)}</title><style>{STYLE}</style>'
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n{content}\n{signature}\n</body></html>\n'


def _summary(dossier: Dossier) -> str:
    counts = {status: sum(each.status is status for each in dossier.verdicts) for status in Status}
    summary = ", ".join(f"{count} {status.value}" for status, count in counts.items() if count) or "no checks"
    points = dossier.open_points
    if points:
        return f"<p><b>Not ready to sign:</b> {escape(summary)}.</p>{_list(points)}"
    return f"<p><b>Every check was run and passed</b> ({escape(summary)}).</p>"


def _verdict(verdict: Verdict) -> str:
    badge = f'<span class="status" style="background:{COLOURS[verdict.status]}">{verdict.status.value}</span>'
    parts = [f"<h3>{escape(verdict.name)} {badge}</h3>"]
    for title, texts in (
        ("Reasons", verdict.reasons),
        ("Failed to run", verdict.failed_to_run),
        ("Not run", verdict.not_run),
        ("Not required", verdict.not_required),
    ):
        if texts:
            parts.append(f"<p>{title}:</p>{_list(texts)}")
    if verdict.facts:
        parts.append(_pairs(verdict.facts))
    parts += [_figure(each) for each in verdict.pictures]
    return f"<section>{''.join(parts)}</section>"


def _failed_to_run(dossier: Dossier) -> tuple[str, ...]:
    return tuple(f"{each.name}: {text}" for each in dossier.verdicts for text in each.failed_to_run)


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


def _section(title: str, content: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{content}</section>"


def _pairs(rows: Iterable[tuple[str, str]]) -> str:
    lines = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    return f"<table>{lines}</table>" if lines else "<p>None.</p>"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    first = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><tr>{first}</tr>{lines}</table>" if rows else "<p>None.</p>"


def _list(texts: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>" if texts else "<p>Nothing.</p>"


def _figure(picture: Picture) -> str:
    if picture.kind not in KINDS:
        raise ValueError(f"a picture is of the kind {picture.kind!r}, there are: {', '.join(KINDS)}")
    data = base64.b64encode(picture.data).decode()
    caption = escape(picture.caption)
    image = f'<img alt="{caption}" src="data:image/{picture.kind};base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
