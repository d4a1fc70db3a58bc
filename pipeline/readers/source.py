"""Sources of motions: folders with licence, credit and stated facts about their files."""

import csv
import dataclasses
import fnmatch
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pipeline.clips.outcome import Reason
from pipeline.errors import FileError, SettingsError
from pipeline.files import settings


@dataclass(frozen=True, kw_only=True)
class Statement:
    """Facts about a source or some of its files, from data/sources.yaml. None: taken from the file."""

    unit: str | None = None
    """Unit of length: `m`, `cm`, `mm`, `inch`, `cmu`, or metres per unit as a number."""
    up: str | None = None
    """The axis that points up: `x`, `y`, `z`, or with a minus sign."""
    fps: float | None = None
    """Frames per second [Hz]; overrides what the file declares."""
    skeleton: str | None = None
    """Name of a skeleton map, or the path of the user's own map (`.yaml`)."""
    asf: str | None = None
    """The ASF file of an AMC: its path, from the AMC's folder if relative."""
    body_model: str | None = None
    """Path of the user's own SMPL body model (`.npz`); without it a mean human skeleton is used."""
    tracks: str | None = None
    """The robot motion that a robot's recording tracked: its path, from the recording's folder."""
    quaternion: str | None = None
    """Order of the root's quaternion in a robot's file that does not name its columns: `wxyz` or `xyzw`."""


NOTHING_STATED = Statement()
"""No stated facts: everything is taken from the file."""


Stated = TypeVar("Stated", bound=Statement)

UNKNOWN_LICENCE = "unknown"

LICENCE_FILES = ("LICENSE", "LICENSE.txt", "LICENSE.md", "LICENCE", "LICENCE.txt", "LICENCE.md")
"""Files whose first line names the licence of the folder they are in."""
LICENCE_BYTES = 10_000
"""Most bytes that are read of a licence file."""
INDEX_BYTES = 20_000_000
"""Largest size of an `index.csv`."""


@dataclass(frozen=True, kw_only=True)
class FileStatement(Statement):
    """Facts about some files of a source; they override those of the whole source."""

    files: str
    """Pattern of paths below the source's folder, such as `takes/*.amc`."""
    licence: str | None = None
    """Licence of these files if it differs from the source's."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """A folder of motion files."""

    name: str
    """First part of its clips' names."""
    folder: Path
    licence: str | None = None
    """Licence of its files, as an SPDX identifier if there is one; None: taken from the folder."""
    credit: str = ""
    """Attribution: author and origin."""
    statement: Statement = NOTHING_STATED
    """Stated facts about all its files."""
    files: tuple[FileStatement, ...] = ()
    """Stated facts about some of the files; later ones override earlier ones."""

    def statement_of(self, path: Path) -> Statement:
        """Stated facts about one file."""
        stated = dataclasses.asdict(self.statement)
        for one in self._matching(path):
            found = {field.name: getattr(one, field.name) for field in dataclasses.fields(Statement)}
            stated.update({name: value for name, value in found.items() if value is not None})
        return Statement(**stated)

    def licence_of(self, path: Path) -> str:
        """Licence of one file: stated; or from its sidecar, `index.csv` or a licence file; or `unknown`."""
        stated = self.stated_licence_of(path)
        if stated is not None:
            return stated
        listed = _index(self.folder)[0].get(self._within(path))
        return _sidecar_licence(path)[0] or listed or _licence_file(self.folder, path) or UNKNOWN_LICENCE

    def stated_licence_of(self, path: Path) -> str | None:
        """Licence of one file stated in data/sources.yaml, regardless of the folder's files."""
        of_file = [one.licence for one in self._matching(path) if one.licence is not None]
        return of_file[-1] if of_file else self.licence

    def notes_of(self, path: Path) -> tuple[Reason, ...]:
        """Notes on errors in one file's sidecar and index, which are then ignored."""
        if self.stated_licence_of(path) is not None:
            return ()
        licence, sidecar_fault = _sidecar_licence(path)
        licences, index_fault = _index(self.folder)
        notes = [("broken_sidecar", sidecar_fault)]
        if index_fault is not None and licence is None and self._within(path) not in licences:
            notes.append(("broken_index", f"the table of licences does not list the motion: {index_fault}"))
        return tuple(Reason(code=code, text=text, effect="noted") for code, text in notes if text is not None)

    def about(self, path: Path) -> dict[str, str | float | None]:
        """All stated facts about one file as a flat dictionary, for digests and provenance."""
        return {**settings.plain(self.statement_of(path)), "licence": self.licence_of(path), "credit": self.credit}

    def _matching(self, path: Path) -> list[FileStatement]:
        return [one for one in self.files if fnmatch.fnmatchcase(self._within(path), one.files)]

    def _within(self, path: Path) -> str:
        return path.relative_to(self.folder).as_posix()


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """One source in data/sources.yaml."""

    name: str
    folder: str
    licence: str
    credit: str = ""
    statement: Statement = NOTHING_STATED
    files: tuple[FileStatement, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Sources:
    """The whole of data/sources.yaml."""

    sources: tuple[_Entry, ...]


def read_sources(path: Path, *, only_there: bool = False) -> tuple[Source, ...]:
    """The sources in a `sources.yaml`; folders and own files are relative to it. Raises SettingsError.

    With `only_there` a source whose folder is missing is left out.
    """
    sources = []
    for entry in settings.read(path, _Sources).sources:
        folder = _folder_of(path, entry)
        if folder is None and only_there:
            continue
        if folder is None:
            raise SettingsError(path, f"the folder {entry.folder[:200]!r} of source '{entry.name}' does not exist.")
        if not entry.name.strip(". ") or set(entry.name) & set("/\\@+~:"):
            raise SettingsError(
                path, f"the source name '{entry.name}' is empty, dots alone or holds one of / \\ @ + ~ :."
            )
        if any(source.name == entry.name for source in sources):
            raise SettingsError(path, f"two sources are named '{entry.name}'.")
        statement = _with_paths(entry.statement, path.parent)
        files = tuple(_with_paths(one, path.parent) for one in entry.files)
        sources.append(Source(**{**vars(entry), "folder": folder, "statement": statement, "files": files}))
    return tuple(sources)


def _folder_of(path: Path, entry: _Entry) -> Path | None:
    """The folder of an entry; None if it does not exist."""
    try:
        folder = (path.parent / Path(entry.folder).expanduser()).resolve()
        return folder if folder.is_dir() else None
    except (OSError, ValueError, RuntimeError):  # too long, with zero bytes, links in a circle, no such user
        return None


def _with_paths(statement: Stated, folder: Path) -> Stated:
    """Make the paths of the user's own files absolute."""
    changed = {}
    for name in ("body_model", "skeleton"):
        value = getattr(statement, name)
        if value is not None and Path(value).suffix in (".npz", ".yaml", ".yml"):
            changed[name] = str((folder / Path(value).expanduser()).resolve())
    return dataclasses.replace(statement, **changed)


def sources_of_environment(
    value: str, known: tuple[Source, ...] = (), names: Mapping[Path, str] | None = None
) -> tuple[Source, ...]:
    """Sources from folders joined by `:`, named after the folders, or as in an earlier run (`names`, by resolved path).

    Folders of `known` sources (data/sources.yaml) are skipped, and names are unique. Raises FileError for a missing
    folder.
    """
    earlier = names or {}
    sources: list[Source] = []
    for text in filter(None, (part.strip() for part in value.split(":"))):
        folder = Path(text).expanduser().resolve()
        if not folder.is_dir():
            raise FileError(text, "BOOSTER_LAB_MOTIONS names it, but it is not a folder.", "Correct the variable.")
        if any(source.folder.resolve() == folder for source in (*known, *sources)):
            continue
        others = {name for path, name in earlier.items() if path != folder}
        taken = {source.name for source in (*known, *sources)} | others
        base = "".join("_" if letter in "/\\@+~:" else letter for letter in folder.name) or "motions"
        before = [earlier[folder]] if folder in earlier else []
        choices = [*before, base, *(f"{base}-{number}" for number in range(2, len(taken) + 3))]
        sources.append(Source(name=next(name for name in choices if name not in taken), folder=folder))
    return tuple(sources)


def read_sidecar(path: Path) -> dict[str, Any]:
    """Content of the YAML file next to a motion; empty if there is none. Raises SettingsError or OSError."""
    sidecar = path.with_suffix(".yaml")
    value = settings.read_yaml(sidecar) if sidecar.is_file() else None
    return value if isinstance(value, dict) else {}


def sidecar_text(path: Path, sidecar: dict[str, Any], key: str, wanted: str) -> str | None:
    """A text in the YAML file next to a motion; None if missing. Raises SettingsError for another type."""
    value = sidecar.get(key)
    if value is not None and not (isinstance(value, str) and value.strip()):
        problem = f"'{key}' is {value!r}, expected {wanted}."
        raise SettingsError(path.with_suffix(".yaml"), problem, "Put it in quotes.")
    return value


def _sidecar_licence(path: Path) -> tuple[str | None, str | None]:
    """The `licence` in the YAML file next to a motion, and the error in that file."""
    try:
        return sidecar_text(path, read_sidecar(path), "licence", "a text"), None
    except OSError as error:
        fault = SettingsError(path.with_suffix(".yaml"), f"it can't be read ({error.strerror}).")
    except SettingsError as error:
        fault = error
    return None, f"the file beside the motion does not state its licence: {fault}"


def _index(folder: Path) -> tuple[dict[str, str], str | None]:
    """Licence of each file that `index.csv` (columns `file`, `licence`) names, and the error in it."""
    index = folder / "index.csv"
    if not index.is_file():
        return {}, None
    stat = index.stat()
    return _licences(index, (stat.st_size, stat.st_mtime_ns))


@functools.lru_cache(maxsize=64)
def _licences(index: Path, state: tuple[int, int]) -> tuple[dict[str, str], str | None]:
    """Content of a table of licences, and the error in it; rows after an error are left out.

    `state`: size and modification time, as cache key.
    """
    licences: dict[str, str] = {}
    if state[0] > INDEX_BYTES:
        return {}, str(FileError(index, f"it has more than the {INDEX_BYTES} bytes allowed."))
    try:
        with index.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
            for row in csv.DictReader(stream):
                if row.get("file"):
                    licences.setdefault(row["file"], row.get("licence") or "")
    except (csv.Error, OSError) as error:
        fault = FileError(index, f"it can't be read from some row on ({error}).", "Shorten or correct the row.")
        return licences, str(fault)
    return licences, None


def _licence_file(folder: Path, path: Path) -> str | None:
    """The first line of the nearest licence file, from the motion's folder up to the source's."""
    for parent in [parent for parent in path.parents if parent.is_relative_to(folder)]:
        for name in LICENCE_FILES:
            if (parent / name).is_file():
                with (parent / name).open("rb") as stream:
                    lines = stream.read(LICENCE_BYTES).decode("utf-8", errors="replace").split("\n")
                return next((line.strip("\0 \t\r")[:100] for line in lines if line.strip("\0 \t\r")), None)
    return None
