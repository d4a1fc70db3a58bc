"""Motion files of a source's folder, and the digest of everything that the clip of a file depends on.

A symbolic link that leaves the folder or is broken is refused, since its target would get this source's licence and
credit.

The motion that a robot tracked is stated in data/sources.yaml (`tracks`), or in the YAML file next to the recording:

    tracks: reference.csv        # from the recording's folder

Reference and recording start at the same time and are of the same robot.
"""

import fnmatch
import os
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.clips.human_clip import HumanClip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError, PipelineError, SettingsError
from pipeline.files import digest
from pipeline.readers.gltf_file import files_beside
from pipeline.readers.read_motion import SUFFIXES, read_motion
from pipeline.readers.source import Source, read_sidecar, sidecar_text
from pipeline.readers.unread import NO_MOTION, POINTER, how_to_convert


@dataclass(frozen=True, kw_only=True)
class Reference:
    """A tracked reference motion that was read from a file."""

    clip: RobotClip
    path: Path
    content: str
    """Digest of its file and of its statements."""


def named_reference(path: Path, source: Source) -> str | None:
    """Stated reference of a recording, or None. Raises SettingsError if the YAML file next to it has no valid path."""
    stated = source.statement_of(path).tracks
    if stated is not None:
        return stated
    try:
        sidecar = read_sidecar(path)
    except SettingsError:
        return None  # reported with the licence
    return sidecar_text(path, sidecar, "tracks", "the path of a motion")


def inside(path: Path, named: str, source: Source) -> Path | None:
    """The path of a recording's reference if it is in the source's folder, even if the file is missing."""
    try:
        folder, target = source.folder.resolve(), (path.parent / named).resolve()
    except (OSError, ValueError, RuntimeError):  # too long, with zero bytes, links in a circle
        return None
    return source.folder / target.relative_to(folder) if target.is_relative_to(folder) else None


def read_reference(path: Path, source: Source, clip: RobotClip | HumanClip) -> Reference | None:
    """Read the motion that the recording `path` tracked; None if none is stated.

    Raises FileError, with both files, for a reference that is missing, outside the source's folder, unreadable or that
    does not match the recording.
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
    """Read the reference motion with that name. Raises FileError."""
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
    """Why a motion can't be the reference of a recording; empty if it can."""
    if not isinstance(clip, RobotClip):
        return "only a robot tracks a motion, and this is a person's"
    if (found.robot, found.joint_names) != (clip.robot, clip.joint_names):
        return f"it is of the robot '{found.robot}', the recording is of '{clip.robot}'"
    if found.duration_s + 1.0 / found.fps < clip.duration_s:
        return f"it is {found.duration_s:.2f} s long, the recording {clip.duration_s:.2f} s; both begin together"
    return ""


def _error(path: Path, named: str, problem: str) -> FileError:
    return FileError(path, f"the motion that it tracked, {named[:300]!r}, does not serve: {problem}.")


def can_be_followed(path: Path, folder: Path) -> bool:
    """Whether `path` is not a link, or a link to an existing target in the source's folder."""
    if not path.is_symlink():
        return True
    try:
        return path.resolve(strict=True).is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # nothing there, no access, or links in a circle
        return False


def refuse_outside_link(path: Path, folder: Path) -> None:
    """Raise FileError for a link that must not be followed; its target is not read."""
    if can_be_followed(path, folder):
        return
    problem = f"a symbolic link (to {path.readlink()}) that leaves the source's folder or leads nowhere is not read."
    raise FileError(path, problem, "Name the folder it points to as a source, or put the file itself here.")


MAX_FILES = 200_000

_SNIFFED_BYTES = 4_096
_TABLE_COLUMNS = ("file", "licence", "license", "skill", "name", "path", "source")
"""First column of tables about motions, which are not motions."""
_NO_MOTIONS = ("readme", "license", "licence", "index", "segments", "credits", "changelog")
"""Names, without suffix, of links out of the folder that are not motions; their content is not read."""


@dataclass(frozen=True, kw_only=True)
class Listing:
    """Content of a source's folder."""

    motions: tuple[Path, ...]
    """Motion files, sorted by their path below the folder."""
    unread: Mapping[str, int]
    """Suffix -> number of files of unsupported formats, without files that contain no motion (pictures, text, code)."""

    def unread_text(self) -> str:
        """`8 files of other formats were not read: .fbx 7, .trc 1`, and how to convert them; may be empty."""
        if not self.unread:
            return ""
        count = sum(self.unread.values())
        found = ", ".join(f"{suffix} {number}" for suffix, number in self.unread.items())
        what = "1 file of another format was" if count == 1 else f"{count} files of other formats were"
        ways = " ".join(f"{suffix}: {way}" for suffix in self.unread if (way := how_to_convert(suffix)))
        return f"{what} not read: {found}. {ways}".rstrip()


def list_motion_files(source: Source) -> list[Path]:
    """Motion files of a source, sorted by their path below its folder; see `list_files`."""
    return list(list_files(source).motions)


def list_files(source: Source) -> Listing:
    """Motion files of a source, and files of formats that are not read.

    Files are selected by suffix; other text and tables (README.txt, index.csv), hidden files and folders are left out.
    A symbolic link that leaves the folder is listed but not followed; `refuse_outside_link` gives the reason. Raises
    FileError if a source has too many files.
    """
    found: list[Path] = []
    unread: Counter[str] = Counter()
    for parent, folders, names in os.walk(source.folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        kinds = {path: _kind(path, source.folder) for path in (Path(parent) / name for name in names)}
        found += [path for path, kind in kinds.items() if kind == "motion"]
        unread.update(path.suffix.lower() for path, kind in kinds.items() if kind == "unread")
        if len(found) > MAX_FILES:
            raise FileError(source.folder, f"it holds more than {MAX_FILES} motion files.", "Split it into sources.")
    motions = tuple(sorted(found, key=lambda path: path.relative_to(source.folder).as_posix()))
    return Listing(motions=motions, unread=dict(sorted(unread.items())))


def source_warnings(source: Source, listing: Listing) -> list[str]:
    """Warnings about a source: files that are not read, no motion files, statements that match no file."""
    warnings = []
    if not listing.motions:
        warnings.append(f"source '{source.name}': there is no motion file in {source.folder}")
    if listing.unread:
        warnings.append(f"source '{source.name}': {listing.unread_text()}")
    within = [path.relative_to(source.folder).as_posix() for path in listing.motions]
    for stated in source.files:
        if not fnmatch.filter(within, stated.files):
            warnings.append(f"source '{source.name}': the pattern '{stated.files}' in data/sources.yaml fits no file")
    return warnings


def _kind(path: Path, folder: Path) -> str:
    """`motion`; `unread` for a file that may contain motion in an unsupported format; else empty."""
    suffix, maybe = path.suffix.lower(), path.stem.lower() not in _NO_MOTIONS
    if path.name.startswith("."):
        return ""
    if not can_be_followed(path, folder):
        return "motion" if suffix in SUFFIXES and maybe else ""
    if not path.is_file():
        return ""
    if suffix not in (".txt", ".csv"):
        return "motion" if suffix in SUFFIXES else "unread" if maybe and suffix not in NO_MOTION else ""
    start = _start(path)
    if start is None:
        return "motion"  # the reader reports the error
    if suffix == ".csv":
        first = start.split("\n")[0].split(",")[0].strip().strip('"').lower()
        return "" if first in _TABLE_COLUMNS else "motion"
    if start.startswith(("{", "[")) or (maybe and start.startswith(POINTER.decode())):
        return "motion"
    return "unread" if maybe and re.match(r"[-+]?\.?\d", start) else ""


def _start(path: Path) -> str | None:
    """The beginning of a text; None where it can't be read."""
    try:
        with path.open("rb") as stream:
            return stream.read(_SNIFFED_BYTES).decode("utf-8-sig", errors="replace").lstrip()
    except OSError:
        return None


def content_digest(path: Path, source: Source) -> str:
    """Digest of a motion file, of the files that belong to it, and of what its source states about it.

    These are the skeletons (`.asf`) next to an `.amc`, the buffers of a `.gltf`, the files named by its statement (the
    user's skeleton map, a body model, an ASF), and the tracked motion with its statement. For a link out of the
    source's folder, only the target's name is used.
    """
    followed = can_be_followed(path, source.folder)
    own = digest.of_file_or_fault(path) if followed else digest.of_json(["link", str(path.readlink())])
    stated, others = source.statement_of(path), []
    if path.suffix.lower() == ".amc":
        others += sorted(each for each in path.parent.iterdir() if each.suffix.lower() == ".asf")
    if path.suffix.lower() == ".gltf" and can_be_followed(path, source.folder):
        others += files_beside(path)
    # a skeleton without a suffix is one of the project's maps
    others += [Path(each) for each in (stated.skeleton, stated.body_model) if each is not None and Path(each).suffix]
    if stated.asf is not None:
        others.append(path.parent / stated.asf)
    try:
        named = named_reference(path, source)
        reference = None if named is None else inside(path, named, source)
        tracked = [named] if reference is None else [named, digest.of_file_or_fault(reference), source.about(reference)]
    except SettingsError as error:
        tracked = [str(error)]
    notes = [note.to_dict() for note in source.notes_of(path)]
    return digest.of_json(
        [own, [[str(each), digest.of_file_or_fault(each)] for each in others], source.about(path), notes, tracked]
    )
