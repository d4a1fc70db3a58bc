"""Links from Dagster's pages to the curator's page, which works while `booster-lab curate` runs."""

from __future__ import annotations

from urllib.parse import quote

import dagster as dg

ADDRESS = "http://127.0.0.1:8090"
"""Where `booster-lab curate` serves unless another port is named."""


def curator_link(page: str) -> dict[str, dg.MarkdownMetadataValue]:
    """The metadata row of a link: `databases`, `proposals`, or `?stage=…` for the clips of a stage."""
    link = f"{ADDRESS}/#/{quote(page, safe='?=&')}"
    return {"curator's page": dg.MetadataValue.md(f"[{link}]({link}) (start it with `booster-lab curate`)")}
