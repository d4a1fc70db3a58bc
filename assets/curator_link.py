"""Links from Dagster's pages to the curator's page, which works while `booster-lab curate` runs."""

from __future__ import annotations

from urllib.parse import quote

import dagster as dg

ADDRESS = "http://127.0.0.1:8090"
"""Where `booster-lab curate` serves unless another port is named."""


def curator_link(page: str) -> dict[str, dg.MarkdownMetadataValue]:
    """The metadata row of a link: `databases`, `proposals`, or `?stage=…` for the clips of a stage."""
    return page_link(f"#/{quote(page, safe='?=&')}", "curator's page")


def page_link(path: str, name: str) -> dict[str, dg.MarkdownMetadataValue]:
    """The metadata row of a link to a path of the curator's server."""
    link = f"{ADDRESS}/{path}"
    return {name: dg.MetadataValue.md(f"[{link}]({link}) (start it with `booster-lab curate`)")}
