"""Frames as the database in place has them: a clip that did not change is not encoded again.

A clip's weight changes with every clip that is added, its frames do not. `.<name>.frames` beside the database notes of
each clip of the store which text its frames became, by code and robot; the text itself is in the database in place.
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
"""Where the frames begin in a clip's file; all before is its head."""


@dataclass(frozen=True, kw_only=True)
class WrittenFrames:
    """The frames of one clip of the store, in a file of a database."""

    file: str
    text_sha256: str
    """Digest of the file from `FRAMES` on."""
    frames: int
    seconds: float
    loop_mode: str

    def text(self, folder: Path) -> bytes | None:
        """The text of the frames from the database in `folder`; None where it is not there as it was."""
        try:
            data = (folder / self.file).read_bytes()
        except OSError:
            return None
        text = data[max(data.find(FRAMES), 0) :]
        return text if digest.of_bytes(text) == self.text_sha256 else None


def read_written(folder: Path, robot: Robot) -> dict[str, WrittenFrames]:
    """What is noted beside the database in `folder`: blob of a clip -> its frames; nothing of other code or robot."""
    try:
        found: Any = read_json(_path(folder))
        if found["of"] != _of(robot):
            return {}
        return {blob: WrittenFrames(**each) for blob, each in found["clips"].items()}
    except (FileError, OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def note_written(folder: Path, robot: Robot, written: Mapping[str, WrittenFrames]) -> None:
    """Note the frames of the clips of a database. Raises FileError where the disk refuses."""
    clips = {blob: dataclasses.asdict(each) for blob, each in written.items()}
    atomic.write_text(_path(folder), json.dumps({"of": _of(robot), "clips": clips}, sort_keys=True))


def _of(robot: Robot) -> list[str]:
    return [code_version("expert"), robot.digest]


def _path(folder: Path) -> Path:
    return swap.beside(folder, "frames")
