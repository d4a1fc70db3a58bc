"""Symbolic links that leave a source's folder, or lead nowhere: what is behind them is not this source's.

Read, it would bear this source's licence and credit.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import FileError


def can_be_followed(path: Path, folder: Path) -> bool:
    """`path` is no link, or one to something that is there and is in the source's folder."""
    if not path.is_symlink():
        return True
    try:
        return path.resolve(strict=True).is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # nothing there, no access, or links in a circle
        return False


def refuse_outside_link(path: Path, folder: Path) -> None:
    """Raises FileError for a link that can't be followed; what it points to is not looked at."""
    if can_be_followed(path, folder):
        return
    problem = f"a symbolic link (to {path.readlink()}) that leaves the source's folder or leads nowhere is not read."
    raise FileError(path, problem, "Name the folder it points to as a source, or put the file itself here.")
