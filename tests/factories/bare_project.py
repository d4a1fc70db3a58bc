"""A project with robots and settings alone."""

import shutil
from pathlib import Path

from pipeline.project import Project


def bare_project(root: Path, folder: Path) -> Project:
    """The robots and settings of the project at `root`, and nothing that was made there."""
    shutil.copytree(root / "robots", folder / "robots", ignore=shutil.ignore_patterns("policies"))
    (folder / "data").mkdir()
    for path in (root / "data").glob("*.yaml"):
        shutil.copy(path, folder / "data")
    return Project(folder)
