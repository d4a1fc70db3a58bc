"""The dataset card of a database (README.md): content, sources, licences and processing stages."""

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from pipeline.expert.licence import classify_licence, strictest
from pipeline.files.shown_text import cell

FILE = "README.md"

COLUMNS = ("source", "licence", "credit", "skill", "seconds", "variant", "stages")
"""Columns of the index used for the card; `source`, `credit` and `variant` may be missing."""

_TAG = re.compile(r"[A-Za-z0-9.+\-]{1,60}")
"""Words allowed in the YAML front matter; other text from files appears in the tables only."""

_DIGITS = 12
"""Number of digits shown of a digest."""

STAGES = {
    "motion_catalog": "files read and measured",
    "selected_motions": "windows of one skill chosen",
    "repaired_motions": "defects filled or cut, put onto the ground, smoothed, contacts labelled",
    "retargeted_motions": "human motion put onto the robot",
    "motion_variants": "mirrored, at other speeds, with other steps or postures",
    "reference_motions": "limits, slip, penetration and likeness checked",
    "augmented_motions": "tracked by a policy in simulation, undisturbed and disturbed",
    "feasible_motions": "feasibility evaluated, weights balanced",
}
"""Stage -> what it does."""

MOST_SOURCES = 200
"""Most rows of the table of sources; further sources are summed up."""


def dataset_card(head: Mapping[str, Any], index: pd.DataFrame) -> str:
    """The card as Markdown, with YAML front matter for dataset hubs; equal clips give equal text.

    Args:
        head: the manifest; robot, frames, stages and schema are used
        index: rows of the clips that the card describes; the columns `COLUMNS` are used
    """
    robot = str(head["robot"])
    licences = sorted({str(licence) for licence in index["licence"]})
    worst = strictest(licences)
    tag = licences[0].lower() if len(licences) == 1 and _TAG.fullmatch(licences[0]) else "other"
    tags = ", ".join(["robotics", "motion", "humanoid", *([robot] if _TAG.fullmatch(robot) else [])])
    counted = "1 clip" if len(index) == 1 else f"{len(index)} clips"
    parts = [
        f"---\nlicense: {tag}\ntags: [{tags}]\n---",
        f"# Expert motions for the {cell(robot)}",
        f"{counted}, {index['seconds'].sum() / 60.0:.1f} minutes at {1.0 / head['frame_duration_s']:g} Hz, "
        f"{head['frame_columns']} numbers a frame.",
        "## Licences\n\n"
        + _table(["licence", "class", "clips", "seconds"], _licences(index))
        + f"\n\nStrictest: **{cell(worst.label)}**. {cell(worst.allowed_use)}",
        "## Sources\n\n" + _table(["source", "licence", "credit", "clips", "seconds"], _sources(index)),
        "## Seconds by skill\n\n" + _table(["skill", "seconds", "clips"], _by(index, ["skill"])),
        "## How it was made\n\nBy Booster Lab: `dagster asset materialize --select expert_db`. Each clip went through "
        "these stages (of code and settings the first digits of their digests):\n\n"
        + _table(["stage", "what it does", "code", "settings"], _stages(head, index)),
        *_variants(index),
        f"Schema `{cell(head['schema'])}`; robot files `{cell(head['robot_digest'][:_DIGITS])}`. `manifest.json` has "
        "the SHA-256 of every file and the settings of every stage, `index.parquet` each clip's source file and what "
        "the stages measured and did.",
    ]
    return "\n\n".join(parts) + "\n"


def _by(index: pd.DataFrame, columns: list[str]) -> list[list[Any]]:
    """One row per group of equal `columns`: their values, then seconds and number of clips."""
    filled = index.assign(**{name: index[name].fillna("") if name in index else "" for name in columns})
    groups = filled.groupby(columns, sort=True)["seconds"].agg(["sum", "count"]).reset_index()
    return [[*row[:-2], f"{row[-2]:.1f}", int(row[-1])] for row in groups.itertuples(index=False, name=None)]


def _licences(index: pd.DataFrame) -> list[list[Any]]:
    rows = _by(index, ["licence"])
    return [[licence, classify_licence(licence).label, clips, seconds] for licence, seconds, clips in rows]


def _sources(index: pd.DataFrame) -> list[list[Any]]:
    rows = _by(index, ["source", "licence", "credit"])
    shown = [[source, licence, credit, clips, seconds] for source, licence, credit, seconds, clips in rows]
    more = len(shown) - MOST_SOURCES
    return shown[:MOST_SOURCES] + ([[f"and {more} more", "", "", "", ""]] if more > 0 else [])


def _stages(head: Mapping[str, Any], index: pd.DataFrame) -> list[list[str]]:
    """Stages in the order in which clips passed them; all stages if the clips do not state theirs."""
    texts = index["stages"].dropna().unique() if "stages" in index else ()
    found = dict.fromkeys(stage for text in texts for stage in _stages_of(text))
    if not found:
        found = dict.fromkeys(
            (str(facts.get("stage", key)), str(facts.get("version", "")), "")
            for key, facts in head["stages"].items()
            if isinstance(facts, dict)
        )
    return [[stage, STAGES.get(stage, ""), version[:_DIGITS], settings[:_DIGITS]] for stage, version, settings in found]


def _stages_of(text: str) -> Iterable[tuple[str, str, str]]:
    """Name, digest of the code and of the settings of each stage of one clip."""
    stages = json.loads(text)
    listed = stages.get("stages") if isinstance(stages, dict) else None
    for each in listed if isinstance(listed, list) else ():
        if isinstance(each, dict):
            yield str(each.get("stage", "")), str(each.get("version", "")), str(each.get("settings", ""))


def _variants(index: pd.DataFrame) -> list[str]:
    """The table of recorded and augmented clips, if the clips state their variant."""
    if "variant" not in index or index["variant"].isna().to_numpy().all():
        return []
    return [_table(["variant", "seconds", "clips"], _by(index, ["variant"]))]


def _table(header: list[str], rows: list[list[Any]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell(value) for value in line) + " |" for line in lines)
