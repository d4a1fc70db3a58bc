"""One motion file of any known format as a clip, with how it was understood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.readers.bvh import read_bvh
from pipeline.readers.human_motion import to_human
from pipeline.readers.raw_motion import RawMotion
from pipeline.readers.statement import Statement


@dataclass(frozen=True, kw_only=True)
class ReadMotion:
    """A clip from a file, and what the reader found out about the file."""

    clip: HumanClip | RobotClip
    format: str
    """`bvh`, `amc`, `smpl`, `deepmimic`, `isaac_amp`, `robot_csv`, `robot_npz` or `robot_qpos`."""
    skeleton: str
    """Name of the skeleton map, or of the robot."""
    declared_fps: float | None
    """Frames per second as the file says [Hz]; `clip.fps` may be stated or derived."""
    unit: str
    """Unit of length of the file."""
    metres_per_unit: float
    up_axis: str
    """The file's axis that points up."""
    files: tuple[Path, ...]
    """Every file that was read: the motion, then what belongs to it."""
    notes: tuple[Reason, ...]
    """What a reader of the data should know; the effect `rejected` keeps the clip from going on."""


def read_motion(path: Path, name: str, statement: Statement = Statement()) -> ReadMotion:
    """The motion in a file as the clip `name`.

    Raises FileError with a sentence for what can't be read, AmbiguousFileError for a unit, axis or rate that the file
    does not tell; its text says how to state it.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise FileError(path, f"'{path.suffix}' is not a motion file; known are: {', '.join(sorted(_READERS))}.")
    return reader(path, name, statement)


def _human(read: Callable[[Path, Statement], RawMotion], path: Path, name: str, statement: Statement) -> ReadMotion:
    motion = read(path, statement)
    canonical = to_human(motion, name, statement)
    return ReadMotion(
        clip=canonical.clip,
        format=motion.format,
        skeleton=canonical.skeleton,
        declared_fps=motion.fps,
        unit=canonical.unit,
        metres_per_unit=canonical.metres_per_unit,
        up_axis=canonical.up_axis,
        files=motion.files,
        notes=motion.notes,
    )


def _read_bvh(path: Path, name: str, statement: Statement) -> ReadMotion:
    return _human(lambda file, _: read_bvh(file), path, name, statement)


_READERS: dict[str, Callable[[Path, str, Statement], ReadMotion]] = {".bvh": _read_bvh}
