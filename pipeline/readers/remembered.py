"""Record of the sources used by runs, so that none is lost because an environment variable is not set.

A folder that was named once by `BOOSTER_LAB_MOTIONS` stays a source until `booster-lab sources forget` removes it. A
source removed from `data/sources.yaml`, a missing folder and a folder that lost all its files are errors, which list
what would be removed from the database.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.files import atomic, settings
from pipeline.files.csv_json import read_json
from pipeline.files.ranges import NOT_NEGATIVE, OneOf
from pipeline.readers.source import Source, read_sources, sources_of_environment

FILE = "data/sources.yaml"
VARIABLE = "BOOSTER_LAB_MOTIONS"


@dataclass(frozen=True, kw_only=True)
class RememberedSource:
    """A source at its last use."""

    name: str
    folder: str
    """Absolute path, links resolved."""
    named_in: Annotated[str, OneOf((FILE, VARIABLE))]
    files: Annotated[int, NOT_NEGATIVE]
    """Number of its motion files."""

    def text(self) -> str:
        """The source as a clause of a message."""
        return f"source '{self.name}' ({self.folder}, {self.files} motion files, named in {self.named_in})"


@dataclass(frozen=True, kw_only=True)
class _Record:
    """Content of the record file, checked by `settings.parse`."""

    sources: tuple[RememberedSource, ...]


@dataclass(frozen=True, kw_only=True)
class SourcesInUse:
    """The sources of a run, in the order in which they are read."""

    stated: tuple[Source, ...]
    """Sources in `data/sources.yaml`."""
    environment: tuple[Source, ...]
    """Sources currently named by `BOOSTER_LAB_MOTIONS`."""
    remembered: tuple[Source, ...]
    """Sources named by the variable only in an earlier run."""

    @property
    def all(self) -> tuple[Source, ...]:
        return self.stated + self.environment + self.remembered


class SourceLostError(PipelineError):
    """Raised if sources of earlier runs are missing, since their clips would be removed from the database."""

    def __init__(self, memory: Path, lost: Sequence[tuple[RememberedSource, str]]):
        listed = "; ".join(f"{source.text()} {why}" for source, why in lost)
        names = " ".join(source.name for source, _ in lost)
        files = sum(source.files for source, _ in lost)
        super().__init__(
            f"{memory}: {listed}. The clips of {files} motion files would leave the database; nothing was changed. "
            f"Bring the source back, or take it out for good: booster-lab sources forget {names}"
        )


def sources_in_use(file: Path, variable: str, memory: Path, *, only_there: bool = False) -> SourcesInUse:
    """Current sources (`data/sources.yaml`, `BOOSTER_LAB_MOTIONS`) and those recorded in the store.

    Raises SettingsError, FileError (a folder of the variable is missing), SourceLostError (a recorded folder is
    missing). With `only_there`, used for single files, stated and recorded sources without a folder are left out.
    """
    known = read_remembered(memory)
    stated = read_sources(file, only_there=only_there)
    names = {Path(each.folder): each.name for each in known if each.named_in == VARIABLE}
    environment = sources_of_environment(variable, stated, names)
    taken = {source.folder.resolve() for source in (*stated, *environment)}
    missing = {folder: name for folder, name in names.items() if folder not in taken}
    gone = [each for each in known if Path(each.folder) in missing and not _is_folder(Path(each.folder))]
    if gone and not only_there:
        raise SourceLostError(memory, [(each, "is not a folder any more") for each in gone])
    for each in gone:
        missing.pop(Path(each.folder), None)
    remembered = sources_of_environment(":".join(map(str, missing)), (*stated, *environment), missing)
    return SourcesInUse(stated=stated, environment=environment, remembered=remembered)


def check_sources(memory: Path, sources: SourcesInUse, files: Mapping[str, int]) -> None:
    """Raise SourceLostError if a recorded source is not in use or has lost all its files.

    `files` is the number of files by source name. A source of `data/sources.yaml` is identified by its name or folder.
    """
    by_folder = {str(source.folder.resolve()): source.name for source in sources.all}
    stated = {source.name for source in sources.stated}
    lost = []
    for each in read_remembered(memory):
        same = each.name if each.named_in == FILE and each.name in stated else None
        name = by_folder.get(each.folder, same)
        if name is None:
            lost.append((each, "is not named any more"))
        elif files[name] == 0 and each.files > 0:
            lost.append((each, "holds no motion file any more (is its disk mounted?)"))
    if lost:
        raise SourceLostError(memory, lost)


def read_remembered(memory: Path) -> tuple[RememberedSource, ...]:
    """Recorded sources, sorted by name; empty without a record. Raises FileError for a damaged record."""
    record = "the record of the sources in use can't be read"
    try:
        if not memory.is_file():
            return ()
        found = settings.parse(_Record, {"sources": read_json(memory)}, memory).sources
    except OSError as error:
        raise FileError(memory, f"{record} ({error}).") from error
    except FileError as error:
        do = "Name all of your sources in data/sources.yaml, then remove this file."
        raise FileError(memory, f"{record} ({error.problem.rstrip('.')}).", do) from error
    return tuple(sorted(found, key=lambda each: each.name))


def remember(memory: Path, sources: SourcesInUse, files: Mapping[str, int]) -> None:
    """Record the sources that a run used, each with its number of files (`check_sources`)."""
    stated = {source.name for source in sources.stated}
    rows = []
    for name, folder in ((source.name, str(source.folder.resolve())) for source in sources.all):
        named_in = FILE if name in stated else VARIABLE
        rows.append(RememberedSource(name=name, folder=folder, named_in=named_in, files=files[name]))
    _write(memory, rows)


def forget(memory: Path, names: Sequence[str]) -> tuple[RememberedSource, ...]:
    """Remove sources from the record and return them. Raises UnknownNameError."""
    known = read_remembered(memory)
    for name in names:
        if name not in {each.name for each in known}:
            raise UnknownNameError("source", name, [each.name for each in known])
    _write(memory, [each for each in known if each.name not in names])
    return tuple(each for each in known if each.name in names)


def _write(memory: Path, rows: Sequence[RememberedSource]) -> None:
    text = json.dumps([asdict(row) for row in rows], indent=1, sort_keys=True) + "\n"
    if not memory.is_file() or memory.read_text() != text:
        atomic.write_text(memory, text)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:
        return False
