"""Reuse encoded frames of the current database for unchanged clips.

A clip's weight changes with every added clip, its frames do not. `.<name>.frames` next to the database records, for
each stored clip, the digest of its frames' text, by code version and robot; the text itself is in the current database.
"""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.batch.code_version import code_version
from pipeline.errors import FileError
from pipeline.files import atomic, digest, swap
from pipeline.files.csv_json import read_json
from pipeline.robot import Robot

FRAMES = b'"Frames": [\n'
"""Start of the frames in a clip's file; everything before is its head."""


@dataclass(frozen=True, kw_only=True)
class WrittenFrames:
    """Encoded frames of a stored clip in a database file."""

    file: str
    text_sha256: str
    """Digest of the file's content from `FRAMES` on."""
    frames: int
    seconds: float
    loop_mode: str

    def text(self, folder: Path) -> bytes | None:
        """The frames' text from the database in `folder`; None if it is missing or changed."""
        try:
            data = (folder / self.file).read_bytes()
        except OSError:
            return None
        text = data[max(data.find(FRAMES), 0) :]
        return text if digest.of_bytes(text) == self.text_sha256 else None


def read_written(folder: Path, robot: Robot) -> dict[str, WrittenFrames]:
    """Read the record next to the database in `folder`: blob of a clip -> its frames; empty for another code or
    robot."""
    try:
        found: Any = read_json(_path(folder))
        if found["of"] != _of(robot):
            return {}
        return {blob: WrittenFrames(**each) for blob, each in found["clips"].items()}
    except (FileError, OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def note_written(folder: Path, robot: Robot, written: Mapping[str, WrittenFrames]) -> None:
    """Write the record of a database's frames. Raises FileError on disk errors."""
    clips = {blob: dataclasses.asdict(each) for blob, each in written.items()}
    atomic.write_text(_path(folder), json.dumps({"of": _of(robot), "clips": clips}, sort_keys=True))


def _of(robot: Robot) -> list[str]:
    return [code_version("expert"), robot.digest]


def _path(folder: Path) -> Path:
    return swap.beside(folder, "frames")
