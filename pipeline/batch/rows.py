"""The two kinds of rows of a manifest: kept clips, and findings on input clips."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A kept clip, the input of the next stage."""

    clip: str
    """Unique name."""
    blob: str
    """Digest of its blob in the store."""
    numbers: dict[str, Any]
    """Numbers of all stages so far; later ones override."""
    record: tuple[dict[str, Any], ...] = ()
    """Record of each stage in order: `{stage, version, settings (a digest), reasons}`."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Findings of the stage on one input clip."""

    clip: str
    pieces: tuple[str, ...]
    """Names of the kept clips made from it."""
    reasons: tuple[dict[str, Any], ...]
    numbers: dict[str, Any]
    """The input's own numbers, with `seconds_in` and `seconds_out` [s]."""

    @property
    def fate(self) -> str:
        """`accepted`, `partly` (some of it was rejected) or `rejected`."""
        return fate_of(self.pieces, self.reasons)


Row = TypeVar("Row", Entry, Judged)


def fate_of(pieces: Sequence[str], reasons: Sequence[dict[str, Any]]) -> str:
    """Fate of an input clip with these kept pieces and reasons."""
    if not pieces:
        return "rejected"
    lost = any(reason["effect"] == "rejected" for reason in reasons)
    return "partly" if lost else "accepted"
