"""The dataset card of a database (README.md): what is in it, from where, under which licences, how it was made."""

from __future__ import annotations

import re
from typing import Any

import pandas as pd

from pipeline.expert.read import Contents
from pipeline.files.shown_text import cell

_TAG = re.compile(r"[A-Za-z0-9.+\-]{1,60}")
"""A licence that may stand in the YAML head; text of a file that looks otherwise stays in the table."""

MOST_SOURCES = 200
"""Rows of the table of sources; more are summed up."""


def dataset_card(contents: Contents) -> str:
    """The card as Markdown, with the YAML head that dataset hubs read."""
    head, index = contents.manifest, contents.index
    licences = sorted(head["licence"]["licences"])
    tag = licences[0].lower() if len(licences) == 1 and _TAG.fullmatch(licences[0]) else "other"
    parts = [
        f"---\nlicense: {tag}\ntags: [robotics, motion, humanoid, {head['robot']}]\n---",
        f"# Expert motions for the {head['robot']}",
        f"{head['clips']} clips, {head['seconds'] / 60.0:.1f} minutes at {1.0 / head['frame_duration_s']:g} Hz, "
        f"{head['frame_columns']} numbers a frame.",
        "## Licences\n\n"
        + _table(["licence", "class", "clips", "seconds"], _licences(head, index))
        + f"\n\nStrictest: **{cell(head['licence']['strictest'])}**. {cell(head['licence']['allowed_use'])}",
        "## Sources\n\n" + _table(["source", "licence", "credit", "clips", "seconds"], _sources(index)),
        "## Seconds by skill\n\n" + _table(["skill", "seconds", "clips"], _by(index, ["skill"])),
        "## How it was made\n\n" + _table(["stage", "version"], _stages(head)) + _variants(index),
        f"Schema `{cell(head['schema'])}`; robot files `{head['robot_digest'][:16]}`. Every file of the database has "
        "its SHA-256 in `manifest.json`, every clip its source file and settings in `index.parquet`.",
    ]
    return "\n\n".join(parts) + "\n"


def _by(index: pd.DataFrame, columns: list[str]) -> list[list[Any]]:
    """Rows of groups: the columns, then seconds and clips."""
    filled = index.assign(**{name: index[name].fillna("") if name in index else "" for name in columns})
    groups = filled.groupby(columns, sort=True)["seconds"].agg(["sum", "count"]).reset_index()
    return [[*row[:-2], f"{row[-2]:.1f}", int(row[-1])] for row in groups.itertuples(index=False, name=None)]


def _licences(head: dict[str, Any], index: pd.DataFrame) -> list[list[Any]]:
    labels = head["licence"]["licences"]
    return [[licence, labels.get(licence, ""), clips, seconds] for licence, seconds, clips in _by(index, ["licence"])]


def _sources(index: pd.DataFrame) -> list[list[Any]]:
    rows = _by(index, ["source", "licence", "credit"])
    shown = [[source, licence, credit, clips, seconds] for source, licence, credit, seconds, clips in rows]
    more = len(shown) - MOST_SOURCES
    return shown[:MOST_SOURCES] + ([[f"and {more} more", "", "", "", ""]] if more > 0 else [])


def _stages(head: dict[str, Any]) -> list[list[Any]]:
    found = {}
    for key, facts in head["stages"].items():
        if isinstance(facts, dict):
            found[str(facts.get("stage", key))] = str(facts.get("version", ""))
    return [[stage, version] for stage, version in found.items()]


def _variants(index: pd.DataFrame) -> str:
    if "variant" not in index:
        return ""
    return "\n\n" + _table(["variant", "seconds", "clips"], _by(index, ["variant"]))


def _table(header: list[str], rows: list[list[Any]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell(value) for value in line) + " |" for line in lines)
