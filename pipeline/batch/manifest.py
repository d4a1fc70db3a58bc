"""The result of a stage: kept clips, findings on each input clip, and settings.

It is stored as a JSON file that references the shards of its rows (`pipeline.batch.shard`).
"""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import pandas as pd

from pipeline.batch.rows import Entry, Judged, Row, fate_of
from pipeline.batch.shard import MISSING, Rows, Shard, shard_of, shards_of
from pipeline.files import digest
from pipeline.files.blob_store import BlobStore

SCHEMA = "booster-lab manifest 2"
SCHEMA_OF_ROWS = "booster-lab manifest 1"
"""Schema of manifests of earlier versions, which contain their rows as JSON."""


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Result of a stage over all clips. Its digest is the data version."""

    stage: str
    entries: Rows[Entry] | tuple[Entry, ...] = ()
    """Clips that are kept."""
    judged: Rows[Judged] | tuple[Judged, ...] = ()
    """Findings on each input clip."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Digest of the settings of each stage so far -> the settings themselves."""
    recomputed: int = 0
    """Number of clips that were computed in this run, not found in the memo. Not part of the content."""
    unsound: tuple[tuple[str, str], ...] = ()
    """Clips and faults of their frames, found when they were made (`pipeline.clips.codec`). Not part of the content."""

    @cached_property
    def entry_shards(self) -> tuple[Shard[Entry], ...]:
        """The clips that are kept, in shards."""
        return self.entries.shards if isinstance(self.entries, Rows) else shards_of(Entry, self.entries)

    @cached_property
    def judged_shards(self) -> tuple[Shard[Judged], ...]:
        """The findings, in shards."""
        return self.judged.shards if isinstance(self.judged, Rows) else shards_of(Judged, self.judged)

    def to_text(self) -> str:
        """JSON text that references the shards; equal content gives equal text, whatever was recomputed."""
        head = {"schema": SCHEMA, "stage": self.stage, "settings": self.settings}
        lines = [f"{json.dumps(name)}: {_json(value)}" for name, value in head.items()]
        for name, shards in (("entries", self.entry_shards), ("judged", self.judged_shards)):
            rows = ",\n".join(_json([shard.digest, shard.count]) for shard in shards)
            lines.append(f'"{name}": [\n{rows}\n]' if rows else f'"{name}": []')
        return "{\n" + ",\n".join(lines) + "\n}\n"

    @staticmethod
    def from_text(text: str, shards: BlobStore) -> Manifest:
        """Inverse of `to_text`; also reads manifests of earlier versions, whose rows are in the text.

        Raises ValueError for another schema.

        Args:
            text: content of the manifest's file
            shards: store of the referenced shards, which are read on demand
        """
        value = json.loads(text)
        schema = value.pop("schema", None)
        if schema == SCHEMA_OF_ROWS:
            entries = tuple(Entry(**{**entry, "record": tuple(entry["record"])}) for entry in value.pop("entries"))
            judged = tuple(
                Judged(**{**row, "pieces": tuple(row["pieces"]), "reasons": tuple(row["reasons"])})
                for row in value.pop("judged")
            )
            manifest = Manifest(entries=entries, judged=judged, **value)
            vars(manifest)["digest"] = digest.of_bytes(text.encode())  # digest of the file, which readers recorded
            return manifest
        if schema != SCHEMA:
            raise ValueError(f"not a manifest of schema {SCHEMA!r}")
        kept = Rows([Shard(Entry, str(name), int(count), shards) for name, count in value.pop("entries")])
        found = Rows([Shard(Judged, str(name), int(count), shards) for name, count in value.pop("judged")])
        return Manifest(entries=kept, judged=found, **value)

    @cached_property
    def digest(self) -> str:
        """Digest of the text."""
        return digest.of_bytes(self.to_text().encode())

    def without(self, dropped: Mapping[str, dict[str, Any]]) -> Manifest:
        """A copy without some clips; the reasons are added to the findings on their input clips.

        Args:
            dropped: name of the clip -> reason, as `Reason.to_dict()` gives it
        """
        kept: list[Shard[Entry]] = []
        gone_s: dict[str, float] = {}
        for shard in self.entry_shards:
            if dropped.keys().isdisjoint(shard.columns(["clip"])["clip"]):
                kept.append(shard)
                continue
            rows = shard.rows()
            gone_s |= {row.clip: float(row.numbers.get("seconds", 0.0)) for row in rows if row.clip in dropped}
            left = [row for row in rows if row.clip not in dropped]
            kept += [shard_of(Entry, left)] if left else []
        judged = [
            shard_of(Judged, [_without(row, dropped, gone_s) for row in shard.rows()])
            if any(not gone_s.keys().isdisjoint(pieces) for pieces in shard.columns(["pieces"])["pieces"])
            else shard
            for shard in self.judged_shards
        ]
        return dataclasses.replace(self, entries=Rows(kept), judged=Rows(judged))

    def at_hand(self) -> Manifest:
        """A copy with all rows in memory, for repeated lookups."""
        return dataclasses.replace(self, entries=tuple(self.entries), judged=tuple(self.judged))

    def with_numbers(self, numbers: Mapping[str, dict[str, Any]]) -> Manifest:
        """A copy with further numbers for some of its clips, by name."""
        return dataclasses.replace(self, entries=Rows([shard.with_numbers(numbers) for shard in self.entry_shards]))

    def entry_table(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """One row per kept clip: `clip` and its numbers, all or the named ones that exist."""
        return _frame(self.entry_shards, columns, hidden=("blob", "record"))

    def judged_table(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """One row per input clip: `clip, fate, seconds_in, seconds_out, reasons` and its numbers, all or named ones."""
        names = None if columns is None else ["clip", "seconds_in", "seconds_out", "pieces", "reasons", *columns]
        table = _frame(self.judged_shards, names, hidden=())
        if table.empty:
            return pd.DataFrame(columns=["clip", "fate", "seconds_in", "seconds_out", "reasons"])
        reasons, pieces = table.pop("reasons"), table.pop("pieces")
        table.insert(1, "fate", [fate_of(*each) for each in zip(pieces, reasons, strict=True)])
        return table.assign(reasons=["; ".join(reason["text"] for reason in each) for each in reasons])

    def fates(self) -> Counter[str]:
        """Number of input clips by fate (`Judged.fate`)."""
        return Counter(fate_of(*each) for each in self.findings("pieces", "reasons"))

    def seconds(self, which: str) -> float:
        """Sum of `seconds_in` or `seconds_out` [s] over the input clips."""
        return float(sum(0.0 if value is MISSING else value or 0.0 for (value,) in self.findings(which)))

    def reason_counts(self, effect: str) -> Counter[str]:
        """Number of occurrences of each reason code with an effect (`rejected`, `repaired`, `noted`)."""
        return Counter(r["code"] for (reasons,) in self.findings("reasons") for r in reasons if r["effect"] == effect)

    def findings(self, *names: str) -> Iterator[tuple[Any, ...]]:
        """Values of the named columns of the findings, one tuple per row; `MISSING` for missing values."""
        return _cells(self.judged_shards, names)

    def kept(self, *names: str) -> Iterator[tuple[Any, ...]]:
        """Values of the named columns of the kept clips, one tuple per row; `MISSING` for missing values."""
        return _cells(self.entry_shards, names)


def _cells(shards: Sequence[Shard[Row]], names: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    for shard in shards:
        columns = shard.columns(names)
        yield from zip(*(columns.get(name, [MISSING] * shard.count) for name in names), strict=True)


def _without(row: Judged, dropped: Mapping[str, dict[str, Any]], gone_s: Mapping[str, float]) -> Judged:
    """The findings on a clip without its dropped pieces, whose durations are in `gone_s` [s]."""
    gone = [name for name in row.pieces if name in gone_s]
    if not gone:
        return row
    seconds_out = row.numbers.get("seconds_out", 0.0) - sum(gone_s[name] for name in gone)
    return dataclasses.replace(
        row,
        pieces=tuple(name for name in row.pieces if name not in gone_s),
        reasons=row.reasons + tuple(dropped[name] for name in gone),
        numbers={**row.numbers, "seconds_out": max(seconds_out, 0.0)},
    )


def _frame(shards: Sequence[Shard[Row]], columns: Sequence[str] | None, hidden: Sequence[str]) -> pd.DataFrame:
    """The rows of shards as a table, with NaN for missing values."""
    cells: dict[str, list[Any]] = {"clip": []}
    count = 0
    for shard in shards:
        for name, values in shard.columns(None if columns is None else ["clip", *columns]).items():
            if name not in hidden:
                cells.setdefault(name, [float("nan")] * count)
                cells[name] += [float("nan") if value is MISSING else value for value in values]
        count += shard.count
        for values in cells.values():
            values += [float("nan")] * (count - len(values))
    return pd.DataFrame(cells)


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False)
