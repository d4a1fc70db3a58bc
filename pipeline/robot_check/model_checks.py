"""The model files of a folder against its tables."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import FileError
from pipeline.robot.description import Description
from pipeline.robot_check.compare import compare, model_of
from pipeline.robot_check.finding import Finding
from pipeline.robot_import.read import read_model

SHOWN = 5
"""Differences of one file that are listed."""


def model_differences(folder: Path, description: Description, files: dict[Path, str]) -> Iterator[Finding]:
    """Model files that are missing, cannot be read, or have other numbers than the tables."""
    for path, text in files.items():
        do = f"Run python -m pipeline.robot.render {folder}"
        if not path.is_file():
            yield Finding(code="model_files", text=f"{path.name} is missing. {do}")
            continue
        if path.read_text(encoding="utf-8", errors="replace") == text:
            continue
        try:
            found = compare(model_of(description, rendered=True), read_model(path))
        except FileError as error:
            yield Finding(code="model_files", text=f"{error} {do}")
            continue
        stated = [each for each in found if each.of_both]
        for each in stated[:SHOWN]:
            yield Finding(code="model_files", text=f"{path.name} differs from the tables: {each}")
        if len(stated) > SHOWN or not stated:
            rest = f"{len(stated) - SHOWN} further numbers" if stated else "only shapes, sites or names"
            yield Finding(code="model_files", text=f"{path.name} differs from the tables: {rest}. {do}")
