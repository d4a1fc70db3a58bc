"""Process clips in a worker process: each outcome becomes an answer of JSON types, its clips are stored.

An error of one clip is its answer and does not affect the others. An error that is not caused by the clip is marked as
`failed`: it is not cached, and the next run tries again.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.batch.rows import Entry
from pipeline.batch.store import Store
from pipeline.clips.codec import faults_of
from pipeline.clips.outcome import Clip, Numbers, Outcome, Piece
from pipeline.errors import ClipError, FileError
from pipeline.files.blob_store import StoreError


def work_on_clips(
    function: Callable[..., Outcome], prepare: Callable[..., Any] | None, store: Store, entries: list[Entry]
) -> list[dict[str, Any]]:
    """Answers for clips of one motion. They share `prepare`, which runs at the first use; if it fails, each clip
    fails."""
    prepared: list[Any] = []

    def work(clip: Clip, numbers: dict[str, Any]) -> Outcome:
        if prepare is None:
            return function(clip, numbers)
        if not prepared:
            prepared.append(prepare(clip))
        return function(clip, numbers, prepared=prepared[0])

    answers, motions = [], _Motions(store)
    for entry in entries:
        clip = motions.get(entry.blob, entry.clip)
        seconds_in = entry.numbers.get("seconds", clip.duration_s)
        answers.append(_answer(partial(work, clip, entry.numbers), motions, entry.clip, seconds_in, entry.numbers))
    return answers


def work_on_files(
    function: Callable[..., Outcome], store: Store, files: list[tuple[str, Path, tuple]]
) -> list[dict[str, Any]]:
    """Answers for files; a file that is not visible to this process is a failure that the next run retries."""
    answers = []
    for name, path, arguments in files:
        if path.exists():
            answers.append(_answer(partial(function, path, name, *arguments), _Motions(store), name, None, {}))
        else:
            text = f"{path}: it is not there for the process that reads it; mount its folder there under this path."
            answers.append(rejection("failed", text, None, failed=True))
    return answers


class _Motions:
    """Cache of a call's motions: a motion shared by several windows is read once, and a motion that a stage returns
    unchanged or in several pieces is encoded and checked once."""

    def __init__(self, store: Store):
        self._store = store
        self._known: list[tuple[Clip, str]] = []
        self._faults: dict[str, list[str]] = {}

    def get(self, blob: str, name: str) -> Clip:
        """The clip of a blob with a name; motions of other blobs are dropped from memory."""
        self._known = [known for known in self._known if known[1] == blob]
        if not self._known:
            self._known = [(self._store.get_clip(blob, name), blob)]
        return dataclasses.replace(self._known[0][0], name=name)

    def put(self, clip: Clip) -> tuple[str, list[str]]:
        """Store a clip's motion; return its blob and the faults of its frames."""
        blob = next((blob for known, blob in self._known if _same_arrays(clip, known)), None)
        if blob is None:
            blob = self._store.put_clip(clip)
            self._known.append((clip, blob))
        if blob not in self._faults:
            self._faults[blob] = faults_of(clip)
        return blob, self._faults[blob]


def _same_arrays(one: Clip, other: Clip) -> bool:
    """Whether two clips have the same arrays in memory (identity, not equality), apart from their names."""
    return type(one) is type(other) and all(
        value is getattr(other, field) for field, value in vars(one).items() if field != "name"
    )


def _answer(
    work: Callable[[], Outcome], motions: _Motions, name: str, seconds_in: float | None, known: Numbers
) -> dict[str, Any]:
    """The outcome as JSON types, with its clips stored. An error of a clip becomes its rejection.

    Only the numbers that the stage added or changed are included; readers merge them with the clip's `known` numbers.
    """
    try:
        outcome = work()
    except StoreError as error:  # from another blob that the stage reads, such as a reference
        return rejection("failed", f"clip '{name}': {error}", seconds_in, failed=True)
    except (ClipError, FileError) as error:
        code = error.code if isinstance(error, ClipError) else "unreadable"
        return rejection(code, str(error), seconds_in)
    except Exception as error:  # a bug must not stop the other clips; the next run retries
        return _fault(error, name, seconds_in)
    try:
        stored = [motions.put(piece.clip) for piece in outcome.pieces]
    except FileError:  # of the store, such as a full disk: stops the run
        raise
    except Exception as error:  # a clip that cannot be encoded, which is also a bug
        return _fault(error, name, seconds_in)
    pieces = [
        {"clip": piece.clip.name, "blob": blob, "numbers": _plain(_new(piece.numbers, known))}
        for piece, (blob, _) in zip(outcome.pieces, stored, strict=True)
    ]
    seconds_out = sum(_seconds(piece) for piece in outcome.pieces)
    numbers = {"seconds_in": seconds_in, "seconds_out": seconds_out, **_plain(outcome.numbers)}
    if numbers["seconds_in"] is None:
        numbers["seconds_in"] = numbers.get("seconds", numbers["seconds_out"])
    return {
        "failed": False,
        "pieces": pieces,
        "unsound": [
            (piece.clip.name, fault)
            for piece, (_, faults) in zip(outcome.pieces, stored, strict=True)
            for fault in faults
        ],
        "reasons": [_plain(reason.to_dict()) for reason in outcome.reasons],
        "numbers": numbers,
    }


def _new(numbers: Numbers, known: Numbers) -> Numbers:
    """Numbers that are not the same objects as the known ones."""
    return {name: value for name, value in numbers.items() if name not in known or value is not known[name]}


def _seconds(piece: Piece) -> float:
    """Length of a piece [s]; a window of a whole clip states its own."""
    return float(piece.numbers.get("seconds") or piece.clip.duration_s)


def _fault(error: Exception, name: str, seconds_in: float | None) -> dict[str, Any]:
    """The answer for a clip on which the stage raised an error."""
    text = f"clip '{name}': the stage failed with {type(error).__name__}: {error}"
    return rejection("failed", text, seconds_in, failed=True)


def rejection(code: str, text: str, seconds_in: float | None, failed: bool = False) -> dict[str, Any]:
    """The answer for a rejected clip; with `failed`, the next run retries."""
    reason = {"code": code, "text": text, "effect": "rejected"}
    numbers = {"seconds_in": seconds_in or 0.0, "seconds_out": 0.0}
    return {"failed": failed, "pieces": [], "unsound": [], "reasons": [reason], "numbers": numbers}


def _plain(numbers: Any) -> dict[str, Any]:
    """JSON types: numpy scalars become Python's, a number that is not finite becomes None."""
    plain = {}
    for name, value in numbers.items():
        value = value.item() if hasattr(value, "item") else value
        plain[name] = None if isinstance(value, float) and not math.isfinite(value) else value
    return plain
