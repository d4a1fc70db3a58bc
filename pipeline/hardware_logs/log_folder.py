"""The input folder of logs: find log files, check that they are complete, identify their content.

For each rejected log a text file with the reason is written if possible; a read-only folder does not stop the ingest.
"""

import contextlib
import os
import re
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from pipeline.errors import FileError
from pipeline.files import atomic, digest
from pipeline.files.blob_store import DigestMemory
from pipeline.files.shown_text import decodable
from pipeline.hardware_logs.ingest import SUFFIXES
from pipeline.hardware_logs.mcap_records import MAGIC

QUARANTINE = "quarantine"
"""Folder of the reasons, one text file per rejected log; logs are not moved there."""
PACKED = {".zstd", ".zst", ".gz", ".zip", ".tar", ".bag"}
QUIET_S = 3.0
"""Time without a write after which a file with a valid end counts as complete [s]."""
FURTHER_TRIAL = re.compile(r"\+[0-9]+$")
"""Suffix of the names of a log's second and further trials."""
STALE_S = 60.0
"""Time without a write after which a file without a valid end is taken as final [s]."""


@dataclass(frozen=True, kw_only=True)
class LogFile:
    """A log and the YAML file next to it."""

    name: str
    """Path below the folder without suffix, or with it if another log or trial has that name."""
    path: Path
    sidecar: Path | None
    content: str
    """Digest of the log's bytes."""
    question: str
    """Digest of the log's and the sidecar's bytes."""


def list_logs(folder: Path) -> list[Path]:
    """All logs below a folder, sorted, except hidden files, which are unfinished copies."""
    return sorted(path for path in _files(folder) if path.suffix in SUFFIXES)


def packed_files(folder: Path) -> list[Path]:
    """Compressed logs, which are not unpacked here, and logs of ROS 1."""
    return sorted(path for path in _files(folder) if path.suffix in PACKED)


def closed_folders(folder: Path) -> list[Path]:
    """Unreadable folders below a folder."""
    closed: list[Path] = []
    for _ in _files(folder, closed):
        pass
    return sorted(closed)


def _files(folder: Path, closed: list[Path] | None = None) -> Iterator[Path]:
    """Files below a folder, except hidden and quarantined ones; folders that can't be listed are added to `closed`."""

    def refused(error: OSError) -> None:
        if closed is not None and Path(error.filename) != folder:
            closed.append(Path(error.filename))

    for parent, folders, names in os.walk(folder, onerror=refused):
        top = Path(parent) == folder
        folders[:] = [name for name in folders if not (name.startswith(".") or (top and name == QUARANTINE))]
        for name in names:
            with contextlib.suppress(OSError):
                if not name.startswith(".") and (Path(parent) / name).is_file():
                    yield Path(parent) / name


def is_whole(path: Path) -> bool:
    """Whether the file has the valid end of its format."""
    with path.open("rb") as stream:
        head = stream.read(100)
        size = path.stat().st_size
        if path.suffix == ".db3":
            unfinished = any(path.with_name(path.name + each).exists() for each in ("-journal", "-wal"))
            page = int.from_bytes(head[16:18], "big")
            pages = int.from_bytes(head[28:32], "big")
            return len(head) == 100 and not unfinished and pages * (65_536 if page == 1 else page) == size
        stream.seek(max(size - len(MAGIC), 0))
        return size > 2 * len(MAGIC) and head.startswith(MAGIC) and stream.read() == MAGIC


def is_complete(path: Path, now_s: float) -> bool:
    """Whether a file is completely written: valid end and unchanged for `QUIET_S`, or unchanged for `STALE_S`.

    Also correct if the file's modification time is in the future because the robot's clock was fast.
    """
    stat = path.stat()
    age_s = now_s - (stat.st_mtime if stat.st_mtime <= now_s else stat.st_ctime)
    return age_s > STALE_S or (age_s > QUIET_S and is_whole(path))


def names_of(paths: list[Path]) -> list[str]:
    """Unique names of logs at these relative paths, which also differ from the names of further trials of other logs.

    The name is the path without suffix. The suffix is kept if another path differs only in the suffix, or if the name
    would be that of a further trial (`x+2` is the second of `x`) or another log's name with suffix.
    """
    stems = [path.with_suffix("").as_posix() for path in paths]
    taken = Counter(stems)
    return [
        stem if taken[stem] == 1 and not FURTHER_TRIAL.search(stem) and Path(stem).suffix not in SUFFIXES else str(path)
        for path, stem in zip(map(Path.as_posix, paths), stems, strict=True)
    ]


def complete_logs(folder: Path, cache: Path, now_s: float | None = None) -> tuple[list[LogFile], list[Path]]:
    """Complete logs by name, and those still being written or unreadable; `cache` is the file of known digests."""
    found, waiting, digests = [], [], DigestMemory(cache)
    paths = list_logs(folder)
    for path, name in zip(paths, names_of([path.relative_to(folder) for path in paths]), strict=True):
        try:
            if not is_complete(path, time.time() if now_s is None else now_s):
                waiting.append(path)
                continue
            sidecar = path.with_suffix(".yaml")
            beside = sidecar if sidecar.is_file() else None
            content = digests.of(path)
            question = digest.of_json([content, digest.of_file(sidecar) if beside else None])
            found.append(LogFile(name=name, path=path, sidecar=beside, content=content, question=question))
        except OSError:
            waiting += [path] if path.exists() else []  # else it was removed meanwhile
    if paths:
        digests.save()
    return found, waiting


def without_copies(logs: list[LogFile], known: dict[str, str]) -> tuple[list[LogFile], list[str]]:
    """Remove duplicate logs, with a sentence for each; `known`: `question` of a log -> name that it keeps."""
    kept: dict[str, LogFile] = {}
    for log in logs:
        other = kept.get(log.question)
        if other is None or known.get(log.question) == log.name:
            kept[log.question] = log
    names = {log.name for log in kept.values()}
    notes = [f"{log.name} has the content of {kept[log.question].name}." for log in logs if log.name not in names]
    return sorted(kept.values(), key=lambda log: log.name), notes


LONGEST_PART = 200
"""Most bytes of a component of a text file's path; file systems allow 255, and temporary names are longer."""
SUFFIX = ".txt"


def note_refusals(folder: Path, refused: Mapping[str, str]) -> list[str]:
    """Write one text file per rejected log (name -> reason) into `folder` and remove others; a sentence for each
    failure.

    The file is `<log>.txt`. If that name is too long, or is a folder of other logs' texts, it is the start of the log's
    name and a digest of the name: `<start>-<digest>.txt`, with `_` for `/`.
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
    """Path of each log's text file below the folder; no path is also a folder of another one."""
    plain = {name: name + SUFFIX for name in names}
    folders = {str(parent) for path in plain.values() for parent in PurePosixPath(path).parents}
    odd = {name for name, path in plain.items() if path in folders or max(map(_size, path.split("/"))) > LONGEST_PART}
    return plain | {name: _shortened(name) for name in odd}


def _shortened(name: str) -> str:
    """The start of a log's name and a digest of the name, as one path component."""
    ending = f"-{digest.of_bytes(os.fsencode(name))[:12]}{SUFFIX}"
    beginning = name.replace("/", "_")
    while _size(beginning + ending) > LONGEST_PART:
        beginning = beginning[:-1]
    return beginning + ending


def _size(part: str) -> int:
    return len(os.fsencode(part))


def _clear(folder: Path, expected: set[str]) -> list[str]:
    """Remove text files of logs that are no longer rejected, and empty folders; return those that can't be removed."""
    problems = []
    for parent, folders, names in os.walk(folder, topdown=False):
        for name in names:
            path = Path(parent) / name
            if path.suffix == SUFFIX and path.relative_to(folder).as_posix() not in expected:
                try:
                    path.unlink()
                except OSError as error:
                    problems.append(f"the sentence on a log that is not refused any more can't be removed: {error}")
        for name in folders:
            with contextlib.suppress(OSError):
                (Path(parent) / name).rmdir()  # only if it is empty
    return problems
