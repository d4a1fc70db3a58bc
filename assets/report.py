"""What a person sees of a stage: numbers that plot over time, a table of clips, pictures."""

import base64
from collections.abc import Sequence
from typing import Any

import dagster as dg
import pandas as pd

from pipeline.batch import Manifest
from pipeline.files.shown_text import escaped

MAX_ROWS = 200
"""Rows of a table that are shown; the manifest has all."""


def stage_metadata(manifest: Manifest, columns: Sequence[str], highest_first: str = "") -> dict[str, Any]:
    """Counts, seconds and reasons of a stage, and its clips with the named numbers, the worst first.

    Clips that went on are in the manifest's order, or those with the largest number `highest_first` come first.
    """
    fates = [row.fate for row in manifest.judged]
    table = manifest.judged_table()
    metadata: dict[str, Any] = {
        "clips in": len(fates),
        "clips out": len(manifest.entries),
        "clips accepted": fates.count("accepted"),
        "clips partly accepted": fates.count("partly"),
        "clips rejected": fates.count("rejected"),
        "seconds in": round(manifest.seconds("seconds_in"), 2),
        "seconds out": round(manifest.seconds("seconds_out"), 2),
        "clips recomputed": manifest.recomputed,
        "dagster/row_count": len(manifest.entries),
        "verdict on each clip": table_of(_worst_first(table), ["clip", "fate", "seconds_in", "seconds_out", "reasons"]),
        "what went on": table_of(
            _highest_first(manifest.entry_table(), highest_first), ["clip", "skill", "seconds", *columns]
        ),
    }
    for effect in ("rejected", "repaired", "noted"):
        counts = manifest.reason_counts(effect)
        if counts:
            lines = [f"| {escaped(code)} | {count} |" for code, count in sorted(counts.items())]
            metadata[f"reasons {effect}"] = dg.MetadataValue.md("\n".join(["| reason | times |", "|---|---|", *lines]))
    return metadata


def _worst_first(table: pd.DataFrame) -> pd.DataFrame:
    order = [("rejected", "partly", "accepted").index(fate) for fate in table["fate"]]
    return table.assign(order=order).sort_values(by=["order", "clip"]).drop(columns="order")


def _highest_first(table: pd.DataFrame, column: str) -> pd.DataFrame:
    if column not in table.columns:
        return table
    return table.sort_values(by=[column, "clip"], ascending=[False, True], na_position="last")


def table_of(frame: pd.DataFrame, columns: Sequence[str]) -> dg.TableMetadataValue:
    """A table of the named columns (those that are there), at most `MAX_ROWS` rows."""
    shown = frame[[name for name in dict.fromkeys(columns) if name in frame.columns]].head(MAX_ROWS)
    names = [str(name) for name in shown.columns]
    records = [
        dg.TableRecord({name: _cell(value) for name, value in zip(names, row, strict=True)})
        for row in shown.itertuples(index=False, name=None)
    ]
    schema = dg.TableSchema(columns=[dg.TableColumn(name, "string") for name in names])
    return dg.MetadataValue.table(records, schema=schema)


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def picture(png: bytes) -> dg.MarkdownMetadataValue:
    """A PNG inside the event, for `Show Markdown`."""
    return dg.MetadataValue.md(f"![picture](data:image/png;base64,{base64.b64encode(png).decode()})")
