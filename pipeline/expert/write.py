"""Write the database: one JSON per clip, an index, a manifest. Equal clips give equal bytes.

<folder>/<clip file>.json    frames of one clip, in the form of Eq. (1)
<folder>/index.parquet       one row per clip: quality, weight, skill, origin
<folder>/README.md           the dataset card: sources, licences, seconds by skill, stages
<folder>/manifest.json       description, digest of every file and of itself, allowed use
"""

import contextlib
import dataclasses
import itertools
import json
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from pipeline import rotation
from pipeline.batch import ClipPool, Store
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError, FileError, PipelineError
from pipeline.expert import dataset_card, history, index, manifest
from pipeline.expert.frames import FPS, columns, expert_frames, frames_of_clips, numbers_text, rounded
from pipeline.expert.read import Contents, DatabaseError, check_database, faults_of_frames, read_clip
from pipeline.expert.written_frames import FRAMES, WrittenFrames, note_written, read_written
from pipeline.files import digest
from pipeline.files.csv_json import json_text
from pipeline.files.swap import current, replace_folder
from pipeline.robot import Robot

HERE = ClipPool(backend="sequential")

A_CALL = 16
"""Clips per task of a writing process."""
AT_A_TIME = 2048
"""Entries in memory when several processes write."""

MAX_JOINT_STEP = 0.05
"""Largest jump of a joint to the start of a loop from one frame after its end [rad] (estimate: 2.5 rad/s)."""

MAX_ROOT_STEP = 0.01
"""The same for the root's height [m] and tilt [rad] (estimate: 0.5 m/s)."""


def loop_mode(clip: RobotClip) -> str:
    """`Wrap` if the first frame can follow the last one, else `Clamp`.

    Joints, root height and gravity in the root frame, extrapolated by one frame from the end at constant velocity, are
    compared with the first frame. Position and heading may differ.
    """
    if clip.frame_count < 3:
        return "Clamp"
    joints = 2.0 * clip.joint_pos[-1] - clip.joint_pos[-2] - clip.joint_pos[0]
    height = 2.0 * clip.root_pos_w[-1, 2] - clip.root_pos_w[-2, 2] - clip.root_pos_w[0, 2]
    down_b = rotation.rotate_inverse(clip.root_quat_w[[0, -2, -1]], np.array([0.0, 0.0, -1.0]))
    tilt = np.linalg.norm(2.0 * down_b[2] - down_b[1] - down_b[0])
    closes = np.max(np.abs(joints)) <= MAX_JOINT_STEP and abs(height) <= MAX_ROOT_STEP and tilt <= MAX_ROOT_STEP
    return "Wrap" if closes else "Clamp"


MAX_LENGTH = 150
"""Longest stem of a file name; with suffix and digest it is below the 255 bytes that file systems allow."""

RESERVED = ("manifest",)
"""Stems of the database's own JSON files."""


def file_name(clip: str) -> str:
    """A readable file name for a clip without folders, unique for each clip.

    `/` becomes `__`. If a name needs further changes (other characters, length, a leading dot, its own `__`), a digest
    of it is added so that it stays unique; also for capital letters, since some file systems ignore case.
    """
    plain = re.sub(r"[^a-zA-Z0-9._~@+-]", "_", clip.replace("/", "__")).lstrip(".") or "_"
    kept = plain == clip.replace("/", "__") and "__" not in clip and plain == plain.lower()
    if kept and len(plain) <= MAX_LENGTH and plain not in RESERVED:
        return f"{plain}.json"
    return f"{plain[:MAX_LENGTH]}-{digest.of_bytes(clip.encode())[:10]}.json"


@dataclass(frozen=True, kw_only=True)
class StoredClip:
    """A clip in the store, which the writing process loads."""

    name: str
    blob: str
    store: Store

    def load(self) -> RobotClip:
        """Load the clip. Raises FileError if the blob is missing or damaged, ClipError if it is not a robot's
        motion."""
        clip = self.store.get_clip(self.blob, self.name)
        if not isinstance(clip, RobotClip):
            raise ClipError(self.name, "kind", "is a human's motion; a database holds a robot's")
        return clip


@dataclass(frozen=True, kw_only=True)
class ExpertEntry:
    """One clip for the database."""

    clip: RobotClip | StoredClip
    weight: float
    """`MotionWeight`: relative sampling probability; positive."""
    skill: str
    licence: str
    """Licence as stated by the source."""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    """Numbers of the stages on the clip (flat, JSON types): quality and origin. They become columns of the index."""
    stages: Mapping[str, Any] = field(default_factory=dict)
    """Version, settings and their digest for each stage that the clip passed, as JSON types."""


class NoClipsError(PipelineError):
    """Raised for a database without clips, which never replaces another one."""

    def __init__(self, folder: Path):
        super().__init__(
            f"{folder}: no clip is left after KP5, and a database without clips is not written. The assets upstream "
            "say why, clip by clip; what was in place is unchanged."
        )


def write_database(
    folder: Path,
    entries: Iterable[ExpertEntry],
    robot: Robot,
    *,
    stages: Mapping[str, Any],
    settings: history.DatabaseSettings | None = None,
    pool: ClipPool = HERE,
) -> Contents:
    """Replace the database in `folder` by one of `entries`; return its manifest and index, read back.

    The new database is checked before it replaces the old one: the frames that are encoded here, the clip files that
    `_write_files` reads back, and every file's digest. The order of the entries doesn't matter; they are written in
    batches and not kept in memory. Raises ClipError for an invalid entry (rate, joints, weight, duplicate name),
    NoClipsError, DatabaseError if a check finds a fault, and FileError on disk errors; the previous database is then
    unchanged.

    Args:
        stages: version and settings of each stage, for the manifest
        settings: keep the old database in the history, and raise DatabaseLossError if the new one loses more than they
            allow; None: the old one is removed without a comparison
        pool: processes that write clips; with several, entries should be stored clips
    """
    made: list[Contents] = []
    known = Known(folder=current(folder), written=read_written(folder, robot), made={})

    def fill(part: Path) -> None:
        rows = sorted(_write_clips(part, entries, robot, pool, known), key=lambda row: row["clip"])
        if not rows:
            raise NoClipsError(folder)
        (part / index.FILE).write_bytes(index.encode(rows))
        head = manifest.facts(rows, robot, stages)
        shown = pd.DataFrame([{name: row.get(name) for name in dataset_card.COLUMNS} for row in rows])
        (part / dataset_card.FILE).write_text(dataset_card.dataset_card(head, shown), encoding="utf-8")
        text = manifest.sealed(part, head, {row["file"]: row["sha256"] for row in rows})
        (part / manifest.FILE).write_text(json_text(text))

    def check(part: Path) -> None:
        made.append(check_database(part, frames=False))  # frames were checked when they were written
        if settings is None:
            return
        loss = history.compare(folder, part, settings.max_lost_share)
        if loss is not None:
            history.keep(folder, part, refused=True)
            history.prune(folder, settings.kept_versions)
            raise loss

    if settings is None:
        replace_folder(folder, fill, check=check)
    else:
        replace_folder(folder, fill, check=check, keep=lambda old: history.keep(folder, old))
        history.prune(folder, settings.kept_versions)
    if known.made:
        with contextlib.suppress(FileError):  # without it the next run encodes all frames again
            note_written(folder, robot, known.made)
    return made[-1]


@dataclass(frozen=True, kw_only=True)
class Known:
    """Cache of encoded frames: of the current database, and of the one being written."""

    folder: Path
    """Folder of the current database."""
    written: Mapping[str, WrittenFrames]
    """Blob of a clip -> its frames in the current database."""
    made: dict[str, WrittenFrames]
    """Blob of a clip -> its frames in the new database."""


def encode_clip(entry: ExpertEntry, robot: Robot) -> bytes:
    """JSON of one clip: keys in a fixed order, one line per frame."""
    clip = entry.clip if isinstance(entry.clip, RobotClip) else entry.clip.load()
    text = _frames_text(rounded(expert_frames(clip, robot), len(robot.controlled)))
    return _head(entry, loop_mode(clip), robot, _columns_text(robot)) + text


def _columns_text(robot: Robot) -> str:
    return json.dumps([vars(column) for column in columns(robot)])


def _head(entry: ExpertEntry, mode: str, robot: Robot, columns_text: str) -> bytes:
    head = {
        "FrameDuration": 1.0 / FPS,
        "MotionWeight": entry.weight,
        "LoopMode": mode,
        "Clip": entry.clip.name,
        "Robot": robot.name,
        "Skill": entry.skill,
        "Licence": entry.licence,
        "QuaternionOrder": "wxyz",
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in head.items()]
    lines.append(f'"Columns": {columns_text}')
    return ("{\n" + ",\n".join(lines) + ",\n").encode()


def _frames_text(frames: Float[np.ndarray, "t c"]) -> bytes:
    return FRAMES + numbers_text(frames) + b"\n]}\n"


def _write_clips(
    part: Path, entries: Iterable[ExpertEntry], robot: Robot, pool: ClipPool, known: Known
) -> Iterator[dict[str, Any]]:
    """Write the clips and yield the index row of each. Raises DatabaseError with the faults from `_write_files`."""
    names: set[str] = set()
    texts: dict[str, str] = {}
    stages, stages_text = None, ""
    faults: list[str] = []
    work = partial(_write_files, part=part, robot=robot, in_place=known.folder)
    for few in _in_batches(entries, pool):
        for entry in few:
            _check(entry, names)
            names.add(entry.clip.name)
        asked = [(dataclasses.replace(entry, numbers={}, stages={}), known.written.get(_blob(entry))) for entry in few]
        calls = [(asked[first : first + A_CALL],) for first in range(0, len(asked), A_CALL)]
        stores = [entry.clip.store for entry in few if isinstance(entry.clip, StoredClip)]
        shared = dict.fromkeys((part.parent, *(folder for store in stores for folder in store.shared_folders)))
        own = stores[0].pool_of_files(pool) if stores else pool
        written = itertools.chain.from_iterable(own.map(work, calls, shared=tuple(shared)))
        for entry, (own, sha256, own_faults) in zip(few, written, strict=True):
            faults += own_faults
            if isinstance(entry.clip, StoredClip):
                known.made[entry.clip.blob] = own
            if entry.stages is not stages:
                stages, text = entry.stages, json.dumps(entry.stages, sort_keys=True, allow_nan=False)
                # Texts about stages are mostly equal across clips: each is stored once.
                stages_text = texts.setdefault(text, text)
            yield index.row(
                entry.numbers,
                clip=entry.clip.name,
                file=own.file,
                sha256=sha256,
                frames=own.frames,
                seconds=own.seconds,
                loop_mode=own.loop_mode,
                weight=entry.weight,
                skill=entry.skill,
                licence=entry.licence,
                stages=stages_text,
            )
    if faults:
        raise DatabaseError(part, faults)


def _in_batches(entries: Iterable[ExpertEntry], pool: ClipPool) -> Iterator[list[ExpertEntry]]:
    """Batches of entries: one at a time if this process writes, else enough to keep all processes busy."""
    rest = iter(entries)
    size = 1 if pool.backend == HERE.backend else AT_A_TIME
    while few := list(itertools.islice(rest, size)):
        yield few


def _blob(entry: ExpertEntry) -> str:
    """Blob digest of a stored clip; empty for a clip in memory."""
    return entry.clip.blob if isinstance(entry.clip, StoredClip) else ""


Written = tuple[WrittenFrames, str, list[str]]
"""Frames of a clip in a file, the file's digest, and its faults."""


def _write_files(
    entries: list[tuple[ExpertEntry, WrittenFrames | None]], *, part: Path, robot: Robot, in_place: Path
) -> list[Written]:
    """Write entries: frames that are in the current database are copied, others are checked and encoded.

    The first encoded file is read back from disk and fully checked. Reading back all files would take as long as
    encoding them; for the others the frames are checked in memory, and the file's digest is compared at the end.
    """
    columns_text, head = _columns_text(robot), manifest.frame_facts(robot)
    copied = [written.text(in_place) if written else None for _, written in entries]
    new = _encoded([entry for (entry, _), text in zip(entries, copied, strict=True) if text is None], robot)
    done: list[Written] = []
    read_back = False
    for (entry, written), text in zip(entries, copied, strict=True):
        faults: list[str] = []
        if written is not None and text is not None:
            own = dataclasses.replace(written, file=file_name(entry.clip.name))
            data = _head(entry, own.loop_mode, robot, columns_text) + text
            (part / own.file).write_bytes(data)
        else:
            own, text, faults = next(new)
            data = _head(entry, own.loop_mode, robot, columns_text) + text
            (part / own.file).write_bytes(data)
            if not read_back:
                faults, read_back = [], True
                read_clip(part, own.file, entry.clip.name, head, faults)
        done.append((own, digest.of_bytes(data), faults))
    return done


def _encoded(entries: Sequence[ExpertEntry], robot: Robot) -> Iterator[tuple[WrittenFrames, bytes, list[str]]]:
    """Frames of each entry, their JSON text and their faults."""
    clips = [entry.clip if isinstance(entry.clip, RobotClip) else entry.clip.load() for entry in entries]
    for clip, frames in zip(clips, frames_of_clips(clips, robot), strict=True):
        frames = rounded(frames, len(robot.controlled))
        text = _frames_text(frames)
        written = WrittenFrames(
            file=file_name(clip.name),
            text_sha256=digest.of_bytes(text),
            frames=clip.frame_count,
            seconds=clip.duration_s,
            loop_mode=loop_mode(clip),
        )
        yield written, text, faults_of_frames(written.file, frames)


def _check(entry: ExpertEntry, names: Container[str]) -> None:
    if entry.clip.name in names:
        raise ClipError(entry.clip.name, "name", "is given twice; names are unique in a database")
    if not 0.0 < entry.weight < float("inf"):
        raise ClipError(entry.clip.name, "weight", f"has the weight {entry.weight:g}; it must be positive")
