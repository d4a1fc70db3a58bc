"""Skip clips that KP5 has already evaluated with the same code, thresholds and robot.

A piece that KP5 kept satisfies all criteria by itself, and the evaluated bytes are stored (the asset check
`stored_as_evaluated` verifies this). So the results of its stretch are also the results of the piece.
"""

import dataclasses
import functools
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import pandas as pd
from pandas.api.types import union_categoricals

from pipeline.batch import Entry, Judged, Manifest, Rows, Stage
from pipeline.batch.shard import Shard, cut, shard_of
from pipeline.feasibility.command_space import SECONDS_COLUMN, VELOCITIES
from pipeline.feasibility.criteria_table import TEXTS
from pipeline.feasibility.criterion import MOTION, REGISTERED
from pipeline.feasibility.gait_signature import COLUMN as SIGNATURE

T = TypeVar("T")


def without_evaluated(candidates: Manifest, stage: Stage, pieces: Collection[str]) -> tuple[Manifest, Rows[Entry]]:
    """Split candidates into those to evaluate and those already evaluated with the code, settings and robot of `stage`.

    Args:
        candidates: clips for KP5
        stage: KP5
        pieces: names of the clips with available results
    """

    asked = (stage.version, stage.settings_digest)

    def is_known(clip: str, record: Sequence[Mapping[str, Any]]) -> bool:
        return clip in pieces and bool(record) and (record[-1]["version"], record[-1]["settings"]) == asked

    rest: list[Shard[Entry]] = []
    known: list[Shard[Entry]] = []
    for shard in candidates.entry_shards:
        columns = shard.columns(["clip", "record"])
        found = [is_known(*row) for row in zip(columns["clip"], columns["record"], strict=True)]
        if all(found) or not any(found):
            (known if found[0] else rest).append(shard)
            continue
        for shards, wanted in ((known, True), (rest, False)):
            rows = [row for row, is_one in zip(shard.rows(), found, strict=True) if is_one == wanted]
            shards.append(shard_of(Entry, rows))
    return dataclasses.replace(candidates, entries=Rows(rest)), Rows(known)


def with_evaluated(manifest: Manifest, stage: Stage, known: Rows[Entry]) -> Manifest:
    """Add the clips that were not evaluated again to a stage's manifest, as if they had been evaluated.

    Only the rows of `SHARDS_AT_HAND` shards of each kind and the names of all clips are in memory.
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
                rows.append(_judged(passed))
                kept.append(passed)
            else:
                rows.append(row)
                kept += [pieces[piece] for piece in row.pieces]
        judged.append(shard_of(Judged, rows))
        entries += [shard_of(Entry, kept)] if kept else []
    return dataclasses.replace(manifest, entries=Rows(entries), judged=Rows(judged))


SHARDS_AT_HAND = 4
"""Number of decoded shards in memory; the names are nearly in the order of their shards."""


class _RowsByClip(Generic[T]):
    """Mapping from a clip's name to its row in shards, with `SHARDS_AT_HAND` shards in memory."""

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


def _judged(entry: Entry) -> Judged:
    seconds = entry.numbers["seconds"]
    names = [code for code, each in REGISTERED.items() if each.of == MOTION]
    names += [*VELOCITIES, SECONDS_COLUMN, SIGNATURE]
    numbers = {name: entry.numbers[name] for name in names if name in entry.numbers}
    whole = {"seconds_in": seconds, "seconds_out": seconds, "seconds": seconds, "kept_seconds": seconds}
    return Judged(clip=entry.clip, pieces=(entry.clip,), reasons=(), numbers={**whole, **numbers})


def criteria_of_pieces(table: pd.DataFrame, known: Rows[Entry]) -> pd.DataFrame:
    """Rows of KP5's table of criteria for pieces that it kept, as if they were evaluated again.

    Args:
        table: rows of the evaluation that produced the pieces, texts as categories
        known: entries of the pieces
    """
    columns = [shard.columns(["clip", "seconds"]) for shard in known.shards]
    seconds = {clip: own for each in columns for clip, own in zip(each["clip"], each["seconds"], strict=True)}
    of_piece = np.array([seconds.get(piece, np.nan) for piece in table["piece"].cat.categories])
    stop_s = of_piece[table["piece"].cat.codes]
    own = table.assign(clip=table["piece"], start_s=0.0, stop_s=stop_s).loc[~np.isnan(stop_s)].reset_index(drop=True)
    return own.assign(**{name: own[name].cat.remove_unused_categories() for name in TEXTS})


def together(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Concatenate tables of criteria, sorted by clip; all rows of a clip must be in one table."""
    texts = {
        name: union_categoricals([pd.Categorical(each[name]) for each in tables], sort_categories=True)
        for name in TEXTS
    }
    table = pd.concat([each.drop(columns=list(texts)) for each in tables], ignore_index=True).assign(**texts)
    order = np.argsort(table["clip"].cat.codes.to_numpy(), kind="stable")
    return table.iloc[order].reset_index(drop=True)[list(tables[0].columns)]
