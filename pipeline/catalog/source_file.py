"""A file of a source read and catalogued: what the graph's first stage does to each file."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from pipeline.catalog.catalogue import catalogue
from pipeline.catalog.settings import CatalogSettings
from pipeline.clips.outcome import Outcome
from pipeline.files import digest
from pipeline.readers import Source, read_motion


def catalogue_file(path: Path, name: str, source: Source, *, settings: CatalogSettings) -> Outcome:
    """The clip in a file, measured; with its source, licence and the digests of what it was read from.

    Raises FileError for a file that can't be read.
    """
    read = read_motion(path, name, source.statement_of(path))
    outcome = catalogue(read, settings=settings)
    origin = {
        "source": source.name,
        "file": path.relative_to(source.folder).as_posix(),
        "file_sha256": digest.of_file(path),
        "read_with": ", ".join(each.name for each in read.files if each != path),
        "licence": source.licence_of(path),
        "credit": source.credit,
    }
    pieces = tuple(
        dataclasses.replace(piece, numbers={**piece.numbers, **origin, "notes": _codes(outcome)})
        for piece in outcome.pieces
    )
    return dataclasses.replace(outcome, pieces=pieces, numbers={**outcome.numbers, **origin})


def _codes(outcome: Outcome) -> str:
    """Codes of what was noted about the file, comma-separated, for the curation."""
    return ", ".join(sorted({reason.code for reason in outcome.reasons}))
