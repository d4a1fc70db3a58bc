"""The motion that a robot tracked: stated in data/sources.yaml (`tracks`), or in the file beside the recording.

    tracks: reference.csv        # from the recording's folder

Reference and recording begin together and are of the same robot.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError, PipelineError, SettingsError
from pipeline.files import digest
from pipeline.readers.read_motion import read_motion
from pipeline.readers.source import Source, read_sidecar, sidecar_text


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A motion that was tracked, as it was read."""

    clip: RobotClip
    path: Path
    content: str
    """Digest of its file and of what is stated of it."""


def named_reference(path: Path, source: Source) -> str | None:
    """The stated reference of a recording; None for most. Raises SettingsError for a file beside it that states
    something else than a path."""
    stated = source.statement_of(path).tracks
    if stated is not None:
        return stated
    try:
        sidecar = read_sidecar(path)
    except SettingsError:
        return None  # noted with the licence
    return sidecar_text(path, sidecar, "tracks", "the path of a motion")


def inside(path: Path, named: str, source: Source) -> Path | None:
    """The path that a recording names, if it is in the source's folder, whether it is there or not."""
    try:
        folder, target = source.folder.resolve(), (path.parent / named).resolve()
    except (OSError, ValueError, RuntimeError):  # too long, with zero bytes, links in a circle
        return None
    return source.folder / target.relative_to(folder) if target.is_relative_to(folder) else None


def read_reference(path: Path, source: Source, clip: RobotClip | HumanClip) -> Reference | None:
    """The motion that the recording `path` tracked; None where nothing names one.

    Args:
        source: where the recording is from; the reference has to lie in its folder
        clip: the recording as it was read

    Raises FileError, which names both files, for a reference that is not there, can't be read or does not fit.
    """
    named = named_reference(path, source)
    if named is None:
        return None
    found = load_reference(path, source, named)
    problem = _misfit(found.clip, clip)
    if problem:
        raise _error(path, named, problem)
    return found


def load_reference(path: Path, source: Source, named: str) -> Reference:
    """The motion of that name, whatever the recording is. Raises FileError."""
    reference = inside(path, named, source)
    if reference is None:
        raise _error(path, named, "it lies outside of the source's folder")
    try:
        there = reference.is_file()
    except OSError:  # a name too long
        there = False
    if not there:
        raise _error(path, named, "it is not there")
    try:
        clip = read_motion(reference, reference.stem, source.statement_of(reference)).clip
    except PipelineError as error:
        raise FileError(path, f"the motion that it tracked can't be read: {error}") from error
    if not isinstance(clip, RobotClip):
        raise _error(path, named, "it is a person's motion; a robot tracks what was retargeted to it")
    return Reference(
        clip=clip, path=reference, content=digest.of_json([digest.of_file(reference), source.about(reference)])
    )


def _misfit(found: RobotClip, clip: RobotClip | HumanClip) -> str:
    """Why a motion can't be what a recording tracked; empty where it can."""
    if not isinstance(clip, RobotClip):
        return "only a robot tracks a motion, and this is a person's"
    if (found.robot, found.joint_names) != (clip.robot, clip.joint_names):
        return f"it is of the robot '{found.robot}', the recording is of '{clip.robot}'"
    if found.duration_s + 1.0 / found.fps < clip.duration_s:
        return f"it is {found.duration_s:.2f} s long, the recording {clip.duration_s:.2f} s; both begin together"
    return ""


def _error(path: Path, named: str, problem: str) -> FileError:
    return FileError(path, f"the motion that it tracked, {named[:300]!r}, does not serve: {problem}.")
