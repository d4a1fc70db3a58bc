"""Facts of a training run from its files, for the model card."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pipeline.errors import FileError

CONFIG, DONE = "config.json", "done.json"
BUNDLE = "bundle"
"""Key of `config.json` with the run's data: digests of robot and database, licence."""
DATA_FACTS = ("robot_digest", "clips", "seconds", "licence")


def training_run(folder: Path, commit: str = "", command: str = "") -> dict[str, Any]:
    """The facts of the run in `folder`: config, end, commit and command. Raises FileError."""
    facts = _read(folder / CONFIG)
    facts.pop(BUNDLE, None)
    ended = _read(folder / DONE) if (folder / DONE).is_file() else {}
    named = {"commit": commit, "command": command}
    return {"name": folder.name, **facts, **ended, **{name: text for name, text in named.items() if text}}


def training_data(folder: Path) -> dict[str, Any]:
    """The facts of the expert database that the run in `folder` was trained on. Raises FileError."""
    facts = _read(folder / CONFIG).get(BUNDLE)
    if not isinstance(facts, dict) or "database_digest" not in facts:
        raise FileError(folder / CONFIG, "does not say which database the run was trained on.", "Train it again.")
    return {"digest": facts["database_digest"], **{name: facts[name] for name in DATA_FACTS if name in facts}}


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name the folder that training wrote.")
    try:
        value = json.loads(path.read_text())
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"is no JSON ({error}).") from error
    if not isinstance(value, dict):
        raise FileError(path, "is no JSON object.")
    return value
