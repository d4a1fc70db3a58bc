"""The motion files below a source's folder."""

from __future__ import annotations

import os
from pathlib import Path

from pipeline.errors import FileError
from pipeline.readers.read_motion import SUFFIXES
from pipeline.readers.source import Source

MAX_FILES = 200_000

_SNIFFED_BYTES = 4_096
_TABLE_COLUMNS = ("file", "licence", "license", "skill", "name", "path", "source")
"""First column of tables about motions, which are not motions."""


def list_motion_files(source: Source) -> list[Path]:
    """Motion files of a source, sorted by their path below its folder.

    By suffix; text and tables that are no motions (README.txt, index.csv), hidden files and folders are left out.
    Raises FileError for a symbolic link that leaves the folder: what is behind it would be read under this
    source's licence.
    """
    found: list[Path] = []
    for parent, folders, names in os.walk(source.folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in [*folders, *names]:
            _check_link(source.folder, Path(parent) / name)
        found += [Path(parent) / name for name in names if _is_motion(Path(parent) / name)]
        if len(found) > MAX_FILES:
            raise FileError(source.folder, f"it holds more than {MAX_FILES} motion files.", "Split it into sources.")
    return sorted(found, key=lambda path: path.relative_to(source.folder).as_posix())


def _check_link(folder: Path, path: Path) -> None:
    if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
        raise FileError(
            path, "a symbolic link that leaves the source's folder.", "Name the folder it points to as a source."
        )


def _is_motion(path: Path) -> bool:
    suffix = path.suffix.lower()
    if path.name.startswith(".") or suffix not in SUFFIXES or not path.is_file():
        return False
    if suffix not in (".txt", ".csv"):
        return True
    with path.open("rb") as stream:
        start = stream.read(_SNIFFED_BYTES).decode("utf-8-sig", errors="replace").lstrip()
    if suffix == ".txt":
        return start.startswith(("{", "["))
    first = start.split("\n")[0].split(",")[0].strip().strip('"').lower()
    return first not in _TABLE_COLUMNS
