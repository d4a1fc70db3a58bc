"""Clips that KP5 evaluated before, with the same code, thresholds and robot: they are not evaluated again.

A piece that left KP5 satisfies all criteria by itself, and its stored bytes are those that were evaluated; that they
still are is what the asset's check `stored_as_evaluated` finds. So its results are those of the stretch that it is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import pandas as pd

from pipeline.batch import Entry, Judged, Manifest, Stage, changed
from pipeline.feasibility.command_space import SECONDS_COLUMN, VELOCITIES
from pipeline.feasibility.criteria_table import NOT_APPLICABLE
from pipeline.feasibility.criterion import MOTION, REGISTERED
from pipeline.feasibility.gait_signature import COLUMN as SIGNATURE
from pipeline.feasibility.judgement import NUMBER, Found, Judgement, to_text

Results = Mapping[str, Mapping[str, Found]]
"""Name of a clip -> code of each criterion -> its result."""

READ = ("piece", "criterion", "number", "threshold", "sense", "verdict", "message")
"""Columns of the table of criteria that results are made of."""


def results_of_pieces(criteria: pd.DataFrame) -> Results:
    """Results on each piece that left KP5, from KP5's table of criteria."""
    kept = criteria[criteria["piece"] != ""]
    found: dict[str, dict[str, Found]] = {}
    columns = [kept[name].tolist() for name in READ]
    for piece, code, number, threshold, sense, verdict, message in zip(*columns, strict=True):
        if verdict == NOT_APPLICABLE:
            result = Found(not_applicable=message)
        else:
            value, limit = (None if each != each else each for each in (number, threshold))  # NaN where there is none
            result = Found(value=value, limit=limit, lower=sense == "at least", unit=REGISTERED[code].unit)
        found.setdefault(piece, {})[code] = result
    return found


def without_evaluated(candidates: Manifest, stage: Stage, results: Results) -> tuple[Manifest, list[Entry]]:
    """The candidates that are still to be evaluated, and those that the code, settings and robot of `stage` evaluated.

    Args:
        candidates: clips for KP5
        stage: KP5
        results: those that are at hand
    """
    if not results:
        return candidates, []
    known = [
        entry
        for entry in candidates.entries
        if entry.clip in results
        and entry.record
        and (entry.record[-1]["version"], entry.record[-1]["settings"]) == (stage.version, stage.settings_digest)
    ]
    names = {entry.clip for entry in known}
    rest = changed(Entry, candidates.entries, lambda entry: None if entry.clip in names else entry)
    return dataclasses.replace(candidates, entries=rest), known


def with_evaluated(manifest: Manifest, stage: Stage, known: list[Entry], results: Results) -> Manifest:
    """The manifest of a stage with the clips that needed no evaluation, as if they had been evaluated too."""
    if not known:
        return manifest
    rows = {row.clip: row for row in manifest.judged}
    entries = {entry.clip: entry for entry in manifest.entries}
    for entry in known:
        passed = _passed(entry, stage)
        entries[entry.clip] = passed
        rows[entry.clip] = _judged(passed, results[entry.clip])
    judged = tuple(rows[clip] for clip in sorted(rows))
    kept = tuple(entries[piece] for row in judged for piece in row.pieces)
    return dataclasses.replace(manifest, entries=kept, judged=judged)


def _passed(entry: Entry, stage: Stage) -> Entry:
    start_s, seconds = float(entry.numbers["stretch_start_s"]), float(entry.numbers["seconds"])
    done = {"stage": stage.name, "version": stage.version, "settings": stage.settings_digest, "reasons": []}
    numbers = {**entry.numbers, "stretch_start_s": start_s, "stretch_stop_s": start_s + seconds}
    return dataclasses.replace(entry, numbers=numbers, record=(*entry.record, done))


def _judged(entry: Entry, found: Mapping[str, Found]) -> Judged:
    seconds = entry.numbers["seconds"]
    judgement = Judgement(start_s=0.0, stop_s=seconds, found=found, piece=entry.clip)
    names = [code for code, each in REGISTERED.items() if each.of == MOTION]
    names += [*VELOCITIES, SECONDS_COLUMN, SIGNATURE]
    numbers = {name: entry.numbers[name] for name in names if name in entry.numbers}
    whole = {"seconds_in": seconds, "seconds_out": seconds, "seconds": seconds, "kept_seconds": seconds}
    text = to_text([judgement])
    return Judged(clip=entry.clip, pieces=(entry.clip,), reasons=(), numbers={**whole, **numbers, NUMBER: text})
