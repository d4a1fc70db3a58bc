"""Read a database and report all its faults."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
from jaxtyping import Float

from pipeline.clips.codec import UNIT_TOLERANCE
from pipeline.errors import FileError, PipelineError
from pipeline.expert import index, manifest
from pipeline.files import digest
from pipeline.files.csv_json import MAX_JSON_BYTES, read_json
from pipeline.files.swap import current

CLIP_KEYS = ("FrameDuration", "MotionWeight", "LoopMode", "Robot", "Skill", "Licence", "Columns", "Frames")
LOOP_MODES = ("Clamp", "Wrap")
QUATERNION = slice(3, 7)
STAGES = "stages"
"""Column of the index with the longest texts; equal texts are stored once in memory."""


class DatabaseError(PipelineError):
    """Raised for an invalid database; lists every fault with its file's name."""

    def __init__(self, folder: Path, faults: list[str]):
        self.faults = tuple(faults)
        listed = "".join(f"\n  {fault}" for fault in faults)
        super().__init__(f"{folder}: not a whole expert database, {len(faults)} faults. Write it again.{listed}")


@dataclass(frozen=True, kw_only=True)
class DatabaseClip:
    """One clip of the database."""

    name: str
    weight: float
    skill: str
    loop_mode: str
    frames: Float[np.ndarray, "t c"]


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Manifest and index of a database that was checked: all files exist, match their digests and are valid."""

    manifest: dict[str, Any]
    index: pd.DataFrame


@dataclass(frozen=True, kw_only=True)
class Database(Contents):
    """A checked database with its frames."""

    clips: tuple[DatabaseClip, ...]
    """In the index's order."""


def read_database(folder: Path) -> Database:
    """Read the database in `folder`. Raises DatabaseError with every fault of every file."""
    clips: list[DatabaseClip] = []
    head, table = _read(folder, clips.append)
    return Database(manifest=head, index=table, clips=tuple(clips))


def check_database(folder: Path, *, frames: bool = True) -> Contents:
    """Check a database without keeping its clips in memory. Raises DatabaseError as `read_database` does.

    Without `frames` no clip is parsed: only digests, manifest and index are checked.
    """
    head, table = _read(folder, (lambda clip: None) if frames else None)
    return Contents(manifest=head, index=table)


def _read(folder: Path, take: Callable[[DatabaseClip], None] | None) -> tuple[dict[str, Any], pd.DataFrame]:
    """Read manifest and index of the database in `folder`, and pass its clips to `take` in the index's order."""
    folder = current(folder)
    faults: list[str] = []
    head = _read_manifest(folder, faults)
    if head is None:
        raise DatabaseError(folder, faults)
    _check_files(folder, head, faults)
    table = _read_index(folder, faults)
    if table is not None:
        if len(table) != head["clips"]:
            faults.append(f"{index.FILE}: has {len(table)} clips, the manifest states {head['clips']}")
        for name, file in zip(table["clip"], table["file"], strict=True):
            if take is None:
                if file not in head["files"]:
                    faults.append(f"{index.FILE}: names the file {file!r}, which is not in the folder")
                continue
            clip = read_clip(folder, file, name, head, faults)
            if clip is not None:
                take(clip)
    if faults or table is None:
        raise DatabaseError(folder, faults)
    return head, table


def _read_manifest(folder: Path, faults: list[str]) -> dict[str, Any] | None:
    path = folder / manifest.FILE
    if not path.is_file():
        faults.append(f"{manifest.FILE}: is missing")
        return None
    head = _read_json(path, faults)
    if head is None:
        return None
    if head.get("schema") != manifest.SCHEMA:
        faults.append(f"{manifest.FILE}: has the schema {head.get('schema')!r}, this version reads {manifest.SCHEMA!r}")
        return None
    broken = manifest.broken_seal(head)
    if broken is not None:
        faults.append(f"{manifest.FILE}: {broken}")
    missing = [key for key in ("robot", "clips", "frame_columns", "frame_duration_s", "files") if key not in head]
    faults += [f"{manifest.FILE}: the key '{key}' is missing" for key in missing]
    return None if missing else head


def _check_files(folder: Path, head: dict[str, Any], faults: list[str]) -> None:
    with os.scandir(folder) as entries:
        plain = {entry.name: entry.is_file(follow_symlinks=False) for entry in entries if entry.name != manifest.FILE}
    stated = head["files"]
    faults += [f"{name}: is missing" for name in sorted(set(stated) - set(plain))]
    faults += [f"{name}: is not in the manifest" for name in sorted(set(plain) - set(stated))]
    both = sorted(set(plain) & set(stated))
    faults += [f"{name}: is a link or a folder, not a file" for name in both if not plain[name]]
    files = [name for name in both if plain[name]]
    found = digest.of_each([folder / name for name in files])
    faults += [
        f"{name}: its content is not the one the manifest states"
        for name, own in zip(files, found, strict=True)
        if own != stated[name]
    ]


def _read_index(folder: Path, faults: list[str]) -> pd.DataFrame | None:
    path = folder / index.FILE
    if path.is_symlink() or not path.is_file():
        return None
    try:
        table = index.read_table(path, [STAGES])
    except (FileError, OSError) as error:
        faults.append(str(error).replace(str(path), path.name, 1))
        return None
    missing = [name for name in index.OWN_COLUMNS if name not in table]
    faults += [f"{index.FILE}: the column '{name}' is missing" for name in missing]
    return None if missing else table


def read_clip(folder: Path, name: str, clip: str, head: dict[str, Any], faults: list[str]) -> DatabaseClip | None:
    """Read the clip in the file `name`; None if it has no valid frames.

    Args:
        folder: folder of the database
        name: file name
        clip: the clip's name
        head: the manifest; `frame_columns` and `frame_duration_s` are used
        faults: list to which every fault is appended
    """
    path = folder / name
    if Path(name).name != name or path.is_symlink() or not path.is_file():
        faults.append(f"{index.FILE}: names the file {name!r}, which is not in the folder")
        return None
    content = _read_json(path, faults, _fast_json(path))
    if content is None:
        return None
    missing = [key for key in CLIP_KEYS if key not in content]
    if missing:
        faults += [f"{name}: the key '{key}' is missing" for key in missing]
        return None
    frames = _frames(name, content, head, faults)
    if content["FrameDuration"] != head["frame_duration_s"]:
        faults.append(f"{name}: FrameDuration is {content['FrameDuration']!r}, expected {head['frame_duration_s']}")
    if content["LoopMode"] not in LOOP_MODES:
        faults.append(f"{name}: LoopMode is {content['LoopMode']!r}, expected one of {', '.join(LOOP_MODES)}")
    weight = content["MotionWeight"]
    if not isinstance(weight, (int, float)) or not 0.0 < weight < float("inf"):
        faults.append(f"{name}: MotionWeight is {weight!r}, expected a positive number")
    if frames is None:
        return None
    return DatabaseClip(name=clip, weight=weight, skill=content["Skill"], loop_mode=content["LoopMode"], frames=frames)


def _frames(name: str, content: dict[str, Any], head: dict[str, Any], faults: list[str]) -> np.ndarray | None:
    wanted = head["frame_columns"]
    if len(content["Columns"]) != wanted:
        faults.append(f"{name}: names {len(content['Columns'])} columns, expected {wanted}")
    try:
        frames = np.array(content["Frames"], dtype=float)
    except (TypeError, ValueError) as error:
        faults.append(f"{name}: Frames are no table of numbers ({error})")
        return None
    if frames.ndim != 2 or frames.shape[1] != wanted or len(frames) < 2:
        faults.append(f"{name}: Frames have the shape {frames.shape}, expected (2 or more, {wanted})")
        return None
    faults += faults_of_frames(name, frames)
    return frames


def faults_of_frames(name: str, frames: Float[np.ndarray, "t c"]) -> list[str]:
    """Faults of the frames in the file `name`: values that are not finite, quaternions that are not unit."""
    faults = []
    if not np.isfinite(frames).all():
        faults.append(f"{name}: frame {int(np.argwhere(~np.isfinite(frames))[0, 0])} has a number that is not finite")
    off = np.abs(np.linalg.norm(frames[:, QUATERNION], axis=1) - 1.0)
    if np.max(off) > UNIT_TOLERANCE:
        frame = int(np.argmax(off))
        faults.append(f"{name}: frame {frame} has a quaternion whose length is off by {off[frame]:.1e}")
    return faults


def _fast_json(path: Path) -> Any:
    """Parse a file four times as fast as `read_json`; None on any error, which `read_json` then reports."""
    try:
        return msgspec.json.decode(path.read_bytes()) if path.stat().st_size <= MAX_JSON_BYTES else None
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, OSError):
        return None


def _read_json(path: Path, faults: list[str], known: Any = None) -> dict[str, Any] | None:
    try:
        value = read_json(path) if known is None else known
    except (FileError, OSError) as error:
        faults.append(str(error).replace(str(path), path.name, 1))
        return None
    if not isinstance(value, dict):
        faults.append(f"{path.name}: is no JSON object")
        return None
    return value
