"""The folder of sentences: a text for each refused log, where a text can be written. None of them stops an ingest."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from pipeline.errors import FileError
from pipeline.files import atomic, digest
from pipeline.files.shown_text import decodable

LONGEST_PART = 200
"""Bytes of a part of a text's path; file systems allow 255, and a text has a longer name while it is written."""
SUFFIX = ".txt"


def note_refusals(folder: Path, refused: Mapping[str, str]) -> list[str]:
    """Make `folder` hold one text for each refused log and no other; a sentence for each that can't be written.

    A log's text is `<log>.txt`. Where that name is too long, or is that of a folder of other logs' texts, it is the
    beginning of the name and a digest.

    Args:
        refused: name of a log, a path without suffix -> why it is refused
    """
    texts = {path: decodable(refused[name]) + "\n" for name, path in text_paths(sorted(refused)).items()}
    problems = _clear(folder, set(texts))
    for path, text in texts.items():
        target = folder / path
        try:
            if not target.is_file() or target.read_bytes() != text.encode():
                atomic.write_text(target, text)
        except (FileError, OSError) as error:
            problems.append(f"the sentence on a refused log can't be written: {' '.join(str(error).split())}")
    return problems


def text_paths(names: list[str]) -> dict[str, str]:
    """Where the text of each log goes, below the folder; no text has the path of another's folder."""
    plain = {name: "/".join(map(_short, (name + SUFFIX).split("/"))) for name in names}
    folders = {str(parent) for path in plain.values() for parent in PurePosixPath(path).parents}
    return {name: _with_digest(path, name) if path in folders else path for name, path in plain.items()}


def _short(part: str) -> str:
    """A part of a path, short enough for a file that is being written."""
    data = os.fsencode(part)
    return part if len(data) <= LONGEST_PART else _with_digest(part, part)


def _with_digest(path: str, name: str) -> str:
    """A path whose last part is shortened and has a digest of `name`."""
    parent, _, last = path.rpartition("/")
    start = os.fsencode(last.removesuffix(SUFFIX))[: LONGEST_PART - 20].decode("utf-8", "ignore")
    made = f"{start}-{digest.of_bytes(os.fsencode(name))[:12]}{SUFFIX}"
    return f"{parent}/{made}" if parent else made


def _clear(folder: Path, wanted: set[str]) -> list[str]:
    """Remove texts of logs that are not refused any more, and folders that hold none; what can't be removed."""
    problems = []
    for parent, folders, names in os.walk(folder, topdown=False):
        for name in names:
            path = Path(parent) / name
            if path.suffix == SUFFIX and path.relative_to(folder).as_posix() not in wanted:
                try:
                    path.unlink()
                except OSError as error:
                    problems.append(f"the sentence on a log that is not refused any more can't be removed: {error}")
        for name in folders:
            with contextlib.suppress(OSError):
                (Path(parent) / name).rmdir()  # one that holds something stays
    return problems
