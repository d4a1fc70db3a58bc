"""History of a database: earlier versions next to it, and restoring one of them.

`.<name>.history/` next to the database has one folder per version, `<number>-<digest>`: the number increases with time,
the digest is the start of the manifest's digest. The suffix `-refused` marks a version that was not put in place
because it lost too much. A version is a complete database and is never modified.
"""

import contextlib
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.expert import manifest
from pipeline.expert.read import check_database
from pipeline.files import atomic, digest, swap
from pipeline.files.csv_json import read_json
from pipeline.files.ranges import SHARE, Range
from pipeline.files.sourced import Unit

REFUSED = "-refused"
"""Suffix of a version that was never in place."""
KEPT_REFUSED = 2
"""Number of refused versions that are kept."""
DIGITS = 12
_NAME = re.compile(rf"(\d{{4,}})-([0-9a-f]{{{DIGITS}}})({REFUSED})?")


@dataclass(frozen=True, kw_only=True)
class DatabaseSettings:
    """`data/database.yaml`."""

    max_lost_share: Annotated[float, SHARE, Unit("share")]
    """Largest share of clips or seconds that a new database may lose relative to the current one."""
    kept_versions: Annotated[int, Range(1, 1000)]
    """Number of earlier versions that are kept."""


@dataclass(frozen=True, kw_only=True)
class Version:
    """One version of a database."""

    name: str
    """Name for `restore`; `current` for the current database."""
    folder: Path
    clips: int
    seconds: float
    by_source: dict[str, int]
    """Name of a source -> number of its clips."""


class DatabaseLossError(PipelineError):
    """Raised if a new database loses more than `data/database.yaml` allows."""

    def __init__(self, folder: Path, new: Version, old: Version, max_lost_share: float):
        fewer = [
            f"{source} {new.by_source.get(source, 0)} of {clips}"
            for source, clips in sorted(old.by_source.items())
            if new.by_source.get(source, 0) < clips
        ]
        super().__init__(
            f"{folder}: the new database has {new.clips} of {old.clips} clips and {new.seconds:.1f} of "
            f"{old.seconds:.1f} s; 'max_lost_share' of data/database.yaml allows to lose {max_lost_share:g}. Clips by "
            f"source: {', '.join(fewer) or 'as before'}. The one in place is unchanged. If the loss is meant, put the "
            f"new one in place: booster-lab database restore {new.name} --robot {folder.name}"
        )


def history_folder(folder: Path) -> Path:
    """Folder of the earlier versions of the database in `folder`."""
    return swap.beside(folder, "history")


def read_versions(folder: Path) -> list[Version]:
    """The earlier versions of a database, the newest first; other entries of the folder are ignored."""
    found = []
    for path in history_folder(folder).glob("*"):
        if _NAME.fullmatch(path.name) and path.is_dir():
            try:
                found.append(describe(path, path.name))
            except FileError:
                continue
    return sorted(found, key=lambda each: _number(each.folder), reverse=True)


def describe(folder: Path, name: str) -> Version:
    """Counts of a database from its manifest. Raises FileError if there is no readable manifest."""
    path = folder / manifest.FILE
    try:
        head: dict[str, Any] = read_json(path)
        clips, seconds = int(head["clips"]), float(head["seconds"])
        by_source = {str(source): int(count) for source, count in head.get("clips_by_source", {}).items()}
    except (FileError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(path, f"not a database's manifest ({error}).", "Materialize expert_db again.") from error
    return Version(name=name, folder=folder, clips=clips, seconds=seconds, by_source=by_source)


def compare(folder: Path, part: Path, max_lost_share: float) -> DatabaseLossError | None:
    """The error if the new database in `part` may not replace the one in `folder`; None if it may.

    If the current one has no readable manifest, the newest version that was in place before is compared.
    """
    before = [each for each in read_versions(folder) if not each.name.endswith(REFUSED)]
    with contextlib.suppress(FileError):
        before.insert(0, describe(swap.current(folder), "current"))
    if not before:
        return None
    old, new = before[0], describe(part, _next_name(folder, part) + REFUSED)
    lost = max(
        1.0 - new.clips / old.clips if old.clips else 0.0, 1.0 - new.seconds / old.seconds if old.seconds else 0.0
    )
    return DatabaseLossError(folder, new, old, max_lost_share) if lost > max_lost_share else None


def keep(folder: Path, version: Path, *, refused: bool = False) -> Path:
    """Move a database (same file system) into the history of `folder`; return its new path."""
    history = history_folder(folder)
    history.mkdir(parents=True, exist_ok=True)
    target = history / (_next_name(folder, version) + (REFUSED if refused else ""))
    version.rename(target)
    for other in history.glob(f"*-{target.name.split('-')[1]}*"):
        if other != target:
            shutil.rmtree(other)
    atomic.sync([target])
    return target


def prune(folder: Path, kept_versions: int) -> None:
    """Remove all but the newest `kept_versions` versions and the newest `KEPT_REFUSED` refused ones."""
    versions = [path for path in history_folder(folder).glob("*") if _NAME.fullmatch(path.name)]
    versions.sort(key=_number, reverse=True)
    were_in_place = [path for path in versions if not path.name.endswith(REFUSED)]
    refused = [path for path in versions if path.name.endswith(REFUSED)]
    for path in (*were_in_place[kept_versions:], *refused[KEPT_REFUSED:]):
        shutil.rmtree(path)


def restore(folder: Path, name: str, approved: Path | None = None) -> Version:
    """Restore a version; the current database becomes the newest version of the history.

    `approved` is the file of approved changes: the version counts as restored while that file is unchanged.

    Raises UnknownNameError, DatabaseError if the version is incomplete, FileError on disk errors or if another process
    writes the database. In each case the current database is unchanged.
    """
    versions = {each.name: each for each in read_versions(folder)}
    if name not in versions:
        raise UnknownNameError("version", name, list(versions))
    check_database(versions[name].folder)
    atomic.write_text(_restored_note(folder), _restored_as(versions[name].folder, approved))
    swap.put_in_place(folder, versions[name].folder, lambda old: keep(folder, old))
    return describe(folder, name)


def was_restored(folder: Path, approved: Path | None = None) -> bool:
    """Whether the current database was restored by a person and nothing else was approved since."""
    try:
        return _restored_note(folder).read_text(encoding="utf-8") == _restored_as(folder, approved)
    except OSError:
        return False


def _restored_note(folder: Path) -> Path:
    """The file next to a database that records the last restored version."""
    return swap.beside(folder, "restored")


def _restored_as(version: Path, approved: Path | None) -> str:
    """Digest of a version's manifest and of the changes approved at the time of restoring."""
    answers = digest.of_file(approved) if approved is not None and approved.is_file() else ""
    return digest.of_json([digest.of_file(version / manifest.FILE), answers])


def _next_name(folder: Path, version: Path) -> str:
    numbers = [_number(path) for path in history_folder(folder).glob("*") if _NAME.fullmatch(path.name)]
    try:
        content = digest.of_file(version / manifest.FILE)
    except OSError:
        content = digest.of_bytes(b"")
    return f"{max(numbers, default=0) + 1:04d}-{content[:DIGITS]}"


def _number(path: Path) -> int:
    return int(path.name.split("-")[0])
