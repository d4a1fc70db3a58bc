"""The value of a stage: which clips are kept, the findings on each input clip, with which settings."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import pandas as pd

from pipeline.files import digest

SCHEMA = "booster-lab manifest 1"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A clip at hand of the next stage."""

    clip: str
    """Unique name."""
    blob: str
    """Digest of its Parquet blob in the store."""
    numbers: dict[str, Any]
    """Numbers of all stages so far; later ones override."""
    record: tuple[dict[str, Any], ...] = ()
    """What each stage did, in order: `{stage, version, settings (a digest), reasons}`."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Findings of the stage on one input clip."""

    clip: str
    pieces: tuple[str, ...]
    """Names of the clips that went on from it."""
    reasons: tuple[dict[str, Any], ...]
    numbers: dict[str, Any]
    """The input's own numbers, with `seconds_in` and `seconds_out` [s]."""

    @property
    def fate(self) -> str:
        """`accepted`, `partly` (some of it was rejected) or `rejected`."""
        if not self.pieces:
            return "rejected"
        lost = any(reason["effect"] == "rejected" for reason in self.reasons)
        return "partly" if lost else "accepted"


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Result of a stage over all clips. Its digest is the data version."""

    stage: str
    entries: tuple[Entry, ...]
    judged: tuple[Judged, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    """Digest of the settings of each stage so far -> the settings themselves."""
    recomputed: int = 0
    """Clips that were worked on in this run and not found in the memo. Not part of the content."""
    unsound: tuple[tuple[str, str], ...] = ()
    """Clip and fault of its frames, as found when it was made (`pipeline.clips.codec`). Not part of the content."""

    def to_text(self) -> str:
        """JSON text, one line a clip; equal content gives equal text, whatever was recomputed."""
        return "".join(self.lines())

    def lines(self) -> Iterator[str]:
        """The text line by line: of many clips it is as long as all that the manifest keeps."""
        yield "{\n"
        head = {"schema": SCHEMA, "stage": self.stage, "settings": self.settings}
        for name, value in head.items():
            yield f'"{name}": {_json(value)},\n'
        for name, rows, end in (("entries", self.entries, "],\n"), ("judged", self.judged, "]\n")):
            yield f'"{name}": [\n'
            for count, row in enumerate(rows, 1):
                yield _json(vars(row)) + (",\n" if count < len(rows) else "")
            yield "\n" + end
        yield "}\n"

    @staticmethod
    def from_text(text: str) -> Manifest:
        """The manifest that `to_text` was called on. Raises ValueError for another schema."""
        value = json.loads(text)
        if value.pop("schema", None) != SCHEMA:
            raise ValueError(f"not a manifest of schema {SCHEMA!r}")
        entries = tuple(Entry(**{**entry, "record": tuple(entry["record"])}) for entry in value.pop("entries"))
        judged = tuple(
            Judged(**{**row, "pieces": tuple(row["pieces"]), "reasons": tuple(row["reasons"])})
            for row in value.pop("judged")
        )
        manifest = Manifest(entries=entries, judged=judged, **value)
        vars(manifest)["digest"] = digest.of_bytes(text.encode())  # what the property would find, without writing it
        return manifest

    @cached_property
    def digest(self) -> str:
        """Digest of the text."""
        return digest.of_parts(line.encode() for line in self.lines())

    def without(self, dropped: Mapping[str, dict[str, Any]]) -> Manifest:
        """The same without some of its clips, each dropped for a reason; their input clips say so.

        Args:
            dropped: name of the clip -> reason, as `Reason.to_dict()` gives it
        """
        gone_s = {entry.clip: float(entry.numbers.get("seconds", 0.0)) for entry in self.entries}
        judged = []
        for row in self.judged:
            gone = [name for name in row.pieces if name in dropped]
            seconds_out = row.numbers.get("seconds_out", 0.0) - sum(gone_s[name] for name in gone)
            judged.append(
                dataclasses.replace(
                    row,
                    pieces=tuple(name for name in row.pieces if name not in dropped),
                    reasons=row.reasons + tuple(dropped[name] for name in gone),
                    numbers={**row.numbers, "seconds_out": max(seconds_out, 0.0)},
                )
            )
        entries = tuple(entry for entry in self.entries if entry.clip not in dropped)
        return dataclasses.replace(self, entries=entries, judged=tuple(judged))

    def with_numbers(self, numbers: Mapping[str, dict[str, Any]]) -> Manifest:
        """The same with further numbers for some of its clips, by name."""
        entries = tuple(
            dataclasses.replace(entry, numbers={**entry.numbers, **numbers.get(entry.clip, {})})
            for entry in self.entries
        )
        return dataclasses.replace(self, entries=entries)

    def entry_table(self) -> pd.DataFrame:
        """One row a clip that goes on: `clip` and its numbers."""
        rows = [{"clip": entry.clip, **entry.numbers} for entry in self.entries]
        return pd.DataFrame(rows, columns=None if rows else ["clip"])

    def judged_table(self) -> pd.DataFrame:
        """One row an input clip: `clip, fate, seconds_in, seconds_out, reasons` and its numbers."""
        rows = [
            {
                "clip": row.clip,
                "fate": row.fate,
                **row.numbers,
                "reasons": "; ".join(reason["text"] for reason in row.reasons),
            }
            for row in self.judged
        ]
        return pd.DataFrame(rows, columns=None if rows else ["clip", "fate", "seconds_in", "seconds_out", "reasons"])

    def seconds(self, which: str) -> float:
        """Sum of `seconds_in` or `seconds_out` [s] over the input clips."""
        return float(sum(row.numbers.get(which, 0.0) or 0.0 for row in self.judged))

    def reason_counts(self, effect: str) -> Counter[str]:
        """How often each reason code stands with an effect (`rejected`, `repaired`, `noted`)."""
        return Counter(r["code"] for row in self.judged for r in row.reasons if r["effect"] == effect)


def _json(value: Any) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False)
