"""The version of a database on disk, cheaply: its manifest's digest, if every file is the one it states."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import FileError
from pipeline.expert import manifest
from pipeline.expert.swap import current
from pipeline.files import digest
from pipeline.files.json_file import read_json


def database_version(folder: Path) -> str:
    """Digest of the manifest. Raises FileError where a file is missing, changed or not stated."""
    folder = current(folder)
    path = folder / manifest.FILE
    if not path.is_file():
        raise FileError(path, "there is no database here.", "Materialize expert_db.")
    head = read_json(path, "a database's manifest", "Materialize expert_db again.")
    try:
        stated, broken = head["files"], manifest.broken_seal(head)
    except (ValueError, KeyError, TypeError) as error:
        raise FileError(path, f"not a database's manifest ({error}).", "Materialize expert_db again.") from error
    if broken is not None:
        raise FileError(path, f"it {broken}.", "Materialize expert_db again.")
    found = {each.name: digest.of_file(each) for each in folder.iterdir() if each.name != manifest.FILE}
    if found != stated:
        raise FileError(folder, "its files are not those its manifest states.", "Materialize expert_db again.")
    return digest.of_file(path)
