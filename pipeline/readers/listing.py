"""The motion files below a source's folder."""

from __future__ import annotations

import os
from pathlib import Path

from pipeline.errors import FileError
from pipeline.readers.outside_link import can_be_followed
from pipeline.readers.read_motion import SUFFIXES
from pipeline.readers.source import Source

MAX_FILES = 200_000

_SNIFFED_BYTES = 4_096
_TABLE_COLUMNS = ("file", "licence", "license", "skill", "name", "path", "source")
"""First column of tables about motions, which are not motions."""
_NO_MOTIONS = ("readme", "license", "licence", "index", "segments", "credits", "changelog")
"""Names, without suffix, of links out of the folder that are not taken for motions; what they hold is not looked at."""


def list_motion_files(source: Source) -> list[Path]:
    """Motion files of a source, sorted by their path below its folder.

    By suffix; text and tables that are no motions (README.txt, index.csv), hidden files and folders are left out. A
    symbolic link that leaves the folder is listed by its name and not followed; `refuse_outside_link` has the reason.
    Raises FileError for more files than a source may have.
    """
    found: list[Path] = []
    for parent, folders, names in os.walk(source.folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        found += [Path(parent) / name for name in names if _is_motion(Path(parent) / name, source.folder)]
        if len(found) > MAX_FILES:
            raise FileError(source.folder, f"it holds more than {MAX_FILES} motion files.", "Split it into sources.")
    return sorted(found, key=lambda path: path.relative_to(source.folder).as_posix())


def _is_motion(path: Path, folder: Path) -> bool:
    suffix = path.suffix.lower()
    if path.name.startswith(".") or suffix not in SUFFIXES:
        return False
    if not can_be_followed(path, folder):
        return path.stem.lower() not in _NO_MOTIONS
    if not path.is_file():
        return False
    if suffix not in (".txt", ".csv"):
        return True
    try:
        with path.open("rb") as stream:
            start = stream.read(_SNIFFED_BYTES).decode("utf-8-sig", errors="replace").lstrip()
    except OSError:
        return True  # the reader says what is wrong with it
    if suffix == ".txt":
        return start.startswith(("{", "["))
    first = start.split("\n")[0].split(",")[0].strip().strip('"').lower()
    return first not in _TABLE_COLUMNS
