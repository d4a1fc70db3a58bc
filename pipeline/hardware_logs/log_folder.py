"""The folder that logs are dropped into: which files are logs, which are whole, what their content is.

Each refused log gets a text beside it where a text can be written; a folder that is read-only stops no ingest.
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
"""Folder of sentences, one for each log that is refused; nothing is moved there."""
PACKED = {".zstd", ".zst", ".gz", ".zip", ".tar", ".bag"}
QUIET_S = 3.0
"""A file that is whole by its format and was not written for so long is complete."""
FURTHER_TRIAL = re.compile(r"\+[0-9]+$")
"""End of the name of a log's second trial and those after it."""
STALE_S = 60.0
"""A file that is incomplete by its format and was not written for this long will not be completed [s]."""


@dataclass(frozen=True, kw_only=True)
class LogFile:
    """A log, and the YAML file beside it."""

    name: str
    """Path below the folder without suffix, or with it where two logs or a trial would have that name too."""
    path: Path
    sidecar: Path | None
    content: str
    """Digest of the log's bytes."""
    question: str
    """Digest of the log's and the sidecar's bytes."""


def list_logs(folder: Path) -> list[Path]:
    """Every log below a folder, in order; files that begin with a dot are of those who copy."""
    return sorted(path for path in _files(folder) if path.suffix in SUFFIXES)


def packed_files(folder: Path) -> list[Path]:
    """Files that look like logs packed by somebody, which are not unpacked here, and logs of ROS 1."""
    return sorted(path for path in _files(folder) if path.suffix in PACKED)


def closed_folders(folder: Path) -> list[Path]:
    """Folders below a folder that can't be read."""
    closed: list[Path] = []
    for _ in _files(folder, closed):
        pass
    return sorted(closed)


def _files(folder: Path, closed: list[Path] | None = None) -> Iterator[Path]:
    """Files below a folder, but hidden and quarantined ones; `closed` takes the folders that can't be listed."""

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
    """Whether the file ends as its format says that it ends."""
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
    """Whether a file is completely written: whole and unchanged for a while, or unchanged for long.

    A copy that kept the time of a robot with a fast clock counts as written at the time of this machine's clock.
    """
    stat = path.stat()
    age_s = now_s - (stat.st_mtime if stat.st_mtime <= now_s else stat.st_ctime)
    return age_s > STALE_S or (age_s > QUIET_S and is_whole(path))


def names_of(paths: list[Path]) -> list[str]:
    """What logs at these relative paths are called: no two alike, and none as a further trial of another one.

    A log is called after its path without suffix. It keeps the suffix where another one differs in that alone, and
    where what is left would read as a further trial (`x+2` is the second of `x`) or as another log's name with suffix.
    """
    stems = [path.with_suffix("").as_posix() for path in paths]
    taken = Counter(stems)
    return [
        stem if taken[stem] == 1 and not FURTHER_TRIAL.search(stem) and Path(stem).suffix not in SUFFIXES else str(path)
        for path, stem in zip(map(Path.as_posix, paths), stems, strict=True)
    ]


def complete_logs(folder: Path, cache: Path, now_s: float | None = None) -> tuple[list[LogFile], list[Path]]:
    """The logs that are complete, by name, and those still being written or unreadable; `cache` remembers digests."""
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
            waiting += [path] if path.exists() else []  # else it was taken away while we looked
    if paths:
        digests.save()
    return found, waiting


def without_copies(logs: list[LogFile], known: dict[str, str]) -> tuple[list[LogFile], list[str]]:
    """Logs without second copies, and a sentence for each; `known`: question of a log -> the name that it keeps."""
    kept: dict[str, LogFile] = {}
    for log in logs:
        other = kept.get(log.question)
        if other is None or known.get(log.question) == log.name:
            kept[log.question] = log
    names = {log.name for log in kept.values()}
    notes = [f"{log.name} has the content of {kept[log.question].name}." for log in logs if log.name not in names]
    return sorted(kept.values(), key=lambda log: log.name), notes


LONGEST_PART = 200
"""Bytes of a part of a text's path; file systems allow 255, and a text has a longer name while it is written."""
SUFFIX = ".txt"


def note_refusals(folder: Path, refused: Mapping[str, str]) -> list[str]:
    """Make `folder` hold one text for each refused log (name -> reason) and no other; a sentence for each that fails.

    A log's text is `<log>.txt`. Where that name is too long, or is that of a folder of other logs' texts, it is the
    beginning of the log's name and a digest of all of it: `<beginning>-<digest>.txt`, `_` for `/`.
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
    plain = {name: name + SUFFIX for name in names}
    folders = {str(parent) for path in plain.values() for parent in PurePosixPath(path).parents}
    odd = {name for name, path in plain.items() if path in folders or max(map(_size, path.split("/"))) > LONGEST_PART}
    return plain | {name: _shortened(name) for name in odd}


def _shortened(name: str) -> str:
    """The beginning of a log's name and a digest of the name, as one part of a path."""
    ending = f"-{digest.of_bytes(os.fsencode(name))[:12]}{SUFFIX}"
    beginning = name.replace("/", "_")
    while _size(beginning + ending) > LONGEST_PART:
        beginning = beginning[:-1]
    return beginning + ending


def _size(part: str) -> int:
    return len(os.fsencode(part))


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
