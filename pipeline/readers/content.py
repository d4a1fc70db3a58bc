"""What the clip of a file depends on, as a digest: a change of any of it makes the clip stale."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import SettingsError
from pipeline.files import digest
from pipeline.readers.outside_link import can_be_followed
from pipeline.readers.source import Source
from pipeline.readers.tracked import inside, named_reference


def content_digest(path: Path, source: Source) -> str:
    """Digest of a motion file, of the files that belong to it, and of what its source states about it.

    To it belong the skeletons (`.asf`) beside an `.amc` and the files that its statement names: a skeleton map of the
    user's own, a body model, an ASF; and the motion that it tracked, with what is stated of that. A motion that is a
    link out of the source's folder is not followed: its target's name counts.
    """
    beside = [each for each in path.parent.iterdir() if each.suffix.lower() == ".asf"] if _is_amc(path) else []
    own = digest.of_json(["link", str(path.readlink())]) if not can_be_followed(path, source.folder) else _of(path)
    others = [[str(each), _of(each)] for each in (*sorted(beside), *_named(path, source))]
    notes = [note.to_dict() for note in source.notes_of(path)]
    return digest.of_json([own, others, source.about(path), notes, _tracked(path, source)])


def _is_amc(path: Path) -> bool:
    return path.suffix.lower() == ".amc"


def _named(path: Path, source: Source) -> list[Path]:
    """Files that the statement names; a skeleton without a suffix is one of the project's maps."""
    stated = source.statement_of(path)
    named = [Path(each) for each in (stated.skeleton, stated.body_model) if each is not None and Path(each).suffix]
    return [*named, path.parent / stated.asf] if stated.asf is not None else named


def _tracked(path: Path, source: Source) -> list:
    """What the motion that a recording tracked is, as far as it is known; nothing for most."""
    try:
        named = named_reference(path, source)
    except SettingsError as error:
        return [str(error)]
    reference = None if named is None else inside(path, named, source)
    return [named] if reference is None else [named, _of(reference), source.about(reference)]


def _of(path: Path) -> str:
    """Digest of a file, or of the reason why it can't be read."""
    try:
        return digest.of_file(path)
    except OSError as error:
        return digest.of_json(["unreadable", error.errno])
