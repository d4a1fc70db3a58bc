"""A file with one fault planted, and what has to become of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

EQUAL, FLAGGED, REFUSED = "equal", "flagged", "refused"


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One of the corpus."""

    name: str
    file: str
    """Name of the file that is asked for."""
    content: bytes | Callable[[Path], object]
    """What it holds, or what puts it there."""
    want: Literal["equal", "flagged", "refused"]
    """The clip of the clean file; a clip with a reason, or none with a reason; or a sentence."""
    says: str = ""
    """Of a refusal: a pattern of the sentence."""
    beside: Mapping[str, bytes] | None = None
    """Further files of the folder."""

    def put(self, folder: Path) -> Path:
        """The file, in a folder of its own."""
        folder.mkdir(parents=True)
        for name, content in (self.beside or {}).items():
            (folder / name).write_bytes(content)
        path = folder / self.file
        if isinstance(self.content, bytes):
            path.write_bytes(self.content)
        else:
            self.content(path)
        return path


def refused(file: str, says: str, contents: Mapping[str, bytes | str], **more) -> list[Mutant]:
    """Mutants that all have to be refused in a sentence like `says`."""
    return [_one(name, file, content, REFUSED, says, more) for name, content in contents.items()]


def understood(file: str, contents: Mapping[str, bytes | str], **more) -> list[Mutant]:
    """Mutants that say the same as the clean file in another way."""
    return [_one(name, file, content, EQUAL, "", more) for name, content in contents.items()]


def flagged(file: str, contents: Mapping[str, bytes | str], **more) -> list[Mutant]:
    """Mutants whose fault some stage has to name."""
    return [_one(name, file, content, FLAGGED, "", more) for name, content in contents.items()]


def _one(name: str, file: str, content: bytes | str, want, says: str, more: dict) -> Mutant:
    data = content.encode() if isinstance(content, str) else content
    return Mutant(name=f"{file}: {name}", file=file, content=data, want=want, says=says, **more)
