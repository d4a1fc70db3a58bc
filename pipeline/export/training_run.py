"""What a training run's own files say of it, as the model card keeps it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pipeline.errors import FileError
from pipeline.export.export_error import ExportError

CONFIG, DONE, BUNDLE = "config.json", "done.json", "bundle.json"
DATABASE = "database_digest"
DATA_FACTS = (DATABASE, "robot_digest", "clips", "seconds", "licence")


def training_run(folder: Path, commit: str = "", command: str = "") -> dict[str, Any]:
    """The facts of the run in `folder`: its config, how it ended where it did, and who made it."""
    facts = _read(folder / CONFIG)
    ended = _read(folder / DONE) if (folder / DONE).is_file() else {}
    named = {"commit": commit, "command": command}
    return {"name": folder.name, **facts, **ended, **{name: text for name, text in named.items() if text}}


def training_data(bundle: Path, run: dict[str, Any]) -> dict[str, Any]:
    """The facts of the database behind a bundle. Raises ExportError where the run was trained on another one."""
    facts = _read(bundle / BUNDLE)
    trained_on = run.get(DATABASE)
    if trained_on is not None and trained_on != facts.get(DATABASE):
        raise ExportError(
            f"run '{run.get('name')}' was trained on the database {trained_on[:12]}, {bundle} is of "
            f"{str(facts.get(DATABASE))[:12]}. Name the bundle that it was trained on."
        )
    kept = {name: facts[name] for name in DATA_FACTS if name in facts}
    return {"digest": facts.get(DATABASE, "not stated"), **kept}


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise FileError(path, "there is no such file.", "Name the folder that training wrote.")
    try:
        value = json.loads(path.read_text())
    except ValueError as error:
        raise FileError(path, f"is no JSON ({error}).") from error
    if not isinstance(value, dict):
        raise FileError(path, "is no JSON object.")
    return value
