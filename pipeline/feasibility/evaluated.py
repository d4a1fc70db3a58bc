"""Clips that KP5 evaluated before, with the same code, thresholds and robot: they are not evaluated again.

A piece that left KP5 satisfies all criteria by itself, and its stored bytes are those that were evaluated; that they
still are is what the asset's check `stored_as_evaluated` finds. So its results are those of the stretch that it is.
"""

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import pandas as pd

from pipeline.batch import Entry, Judged, Manifest, Rows, Stage, changed
from pipeline.batch.shard import Shard, cut, shard_of
from pipeline.feasibility.command_space import SECONDS_COLUMN, VELOCITIES
from pipeline.feasibility.criteria_table import NOT_APPLICABLE
from pipeline.feasibility.criterion import MOTION, REGISTERED
from pipeline.feasibility.gait_signature import COLUMN as SIGNATURE
from pipeline.feasibility.judgement import NUMBER, Found, Judgement, to_text

T = TypeVar("T")

Results = Mapping[str, Mapping[str, Found]]
"""Name of a clip -> code of each criterion -> its result."""

READ = ("piece", "criterion", "number", "threshold", "sense", "verdict", "message")
"""Columns of the table of criteria that results are made of."""
TEXTS = ("piece", "criterion", "sense", "verdict", "message")
"""Those of them that are texts."""


class ResultsOfPieces(Results):
    """Results on each piece that left KP5, from the columns `READ` of KP5's table of criteria; made when asked for."""

    def __init__(self, criteria: pd.DataFrame):
        kept = criteria.loc[criteria["piece"] != "", list(READ)]
        kept = kept.astype(dict.fromkeys(TEXTS, "category"))
        piece = kept.pop("piece").cat
        starts = np.flatnonzero(np.diff(piece.codes, prepend=-1))
        names = piece.categories[piece.codes.iloc[starts]]
        self._place = dict(zip(names, zip(starts, [*starts[1:], len(kept)], strict=True), strict=True))
        self._texts = {
            name: (kept[name].cat.codes.to_numpy(), kept[name].cat.categories.tolist()) for name in TEXTS[1:]
        }
        self._numbers = kept[["number", "threshold"]].to_numpy()

    def __getitem__(self, piece: str) -> dict[str, Found]:
        rows = slice(*self._place[piece])
        texts = [[known[code] for code in codes[rows].tolist()] for codes, known in self._texts.values()]
        values = self._numbers[rows].tolist()
        return {code: _found(code, *numbers, *others) for code, *others, numbers in zip(*texts, values, strict=True)}

    def __contains__(self, piece: object) -> bool:
        return piece in self._place

    def __iter__(self) -> Iterator[str]:
        return iter(self._place)

    def __len__(self) -> int:
        return len(self._place)


def _found(code: str, number: float, threshold: float, sense: str, verdict: str, message: str) -> Found:
    if verdict == NOT_APPLICABLE:
        return Found(not_applicable=message)
    value, limit = (None if each != each else each for each in (number, threshold))  # NaN where there is none
    return Found(value=value, limit=limit, lower=sense == "at least", unit=REGISTERED[code].unit)


def without_evaluated(candidates: Manifest, stage: Stage, results: Results) -> tuple[Manifest, Rows[Entry]]:
    """The candidates that are still to be evaluated, and those that the code, settings and robot of `stage` evaluated.

    Args:
        candidates: clips for KP5
        stage: KP5
        results: those that are at hand
    """

    asked = (stage.version, stage.settings_digest)

    def is_known(entry: Entry) -> bool:
        last = entry.record[-1] if entry.record and entry.clip in results else None
        return last is not None and (last["version"], last["settings"]) == asked

    rest = changed(Entry, candidates.entries, lambda entry: None if is_known(entry) else entry)
    known = changed(Entry, candidates.entries, lambda entry: entry if is_known(entry) else None)
    return dataclasses.replace(candidates, entries=rest), known


def with_evaluated(manifest: Manifest, stage: Stage, known: Rows[Entry], results: Results) -> Manifest:
    """The manifest of a stage with the clips that needed no evaluation, as if they had been evaluated too.

    Rows of `SHARDS_AT_HAND` shards of each kind at a time are in memory; of all clips, only the names.
    """
    if not known:
        return manifest
    findings = _RowsByClip[Judged | Entry]((*manifest.judged_shards, *known.shards))
    pieces = _RowsByClip[Entry](manifest.entry_shards)
    done = {"stage": stage.name, "version": stage.version, "settings": stage.settings_digest, "reasons": []}

    entries: list[Shard[Entry]] = []
    judged: list[Shard[Judged]] = []
    names = sorted(findings.clips)
    for part in cut(names):
        rows: list[Judged] = []
        kept: list[Entry] = []
        for clip in names[part]:
            row = findings[clip]
            if isinstance(row, Entry):
                passed = _passed(row, done)
                rows.append(_judged(passed, results[clip]))
                kept.append(passed)
            else:
                rows.append(row)
                kept += [pieces[piece] for piece in row.pieces]
        judged.append(shard_of(Judged, rows))
        entries += [shard_of(Entry, kept)] if kept else []
    return dataclasses.replace(manifest, entries=Rows(entries), judged=Rows(judged))


SHARDS_AT_HAND = 4
"""Names are nearly in the order of the shards that they are in: so many are decoded at a time."""


class _RowsByClip(Generic[T]):
    """The rows of shards by the names of their clips, those of `SHARDS_AT_HAND` shards at a time in memory."""

    def __init__(self, shards: Sequence[Shard[Any]]):
        self._shard = {clip: shard for shard in shards for clip in shard.columns(["clip"])["clip"]}
        self._rows_of = functools.lru_cache(maxsize=SHARDS_AT_HAND)(_by_clip)

    @property
    def clips(self) -> Iterable[str]:
        return self._shard

    def __getitem__(self, clip: str) -> T:
        return self._rows_of(self._shard[clip])[clip]


def _by_clip(shard: Shard[Any]) -> dict[str, Any]:
    return {row.clip: row for row in shard.rows()}


def _passed(entry: Entry, done: dict[str, Any]) -> Entry:
    start_s, seconds = float(entry.numbers["stretch_start_s"]), float(entry.numbers["seconds"])
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
