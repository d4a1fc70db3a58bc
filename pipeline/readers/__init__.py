"""Readers: motion files of every known format in, clips on the canonical skeleton out."""

from pipeline.readers.content import content_digest
from pipeline.readers.listing import list_motion_files
from pipeline.readers.outside_link import refuse_outside_link
from pipeline.readers.read_motion import ReadMotion, read_motion
from pipeline.readers.remembered import SourceLostError, SourcesInUse, sources_in_use
from pipeline.readers.source import FileStatement, Source, read_sources, sources_of_environment
from pipeline.readers.statement import NOTHING_STATED, Statement
from pipeline.readers.tracked import Reference, read_reference

__all__ = [
    "NOTHING_STATED",
    "FileStatement",
    "ReadMotion",
    "Reference",
    "Source",
    "SourceLostError",
    "SourcesInUse",
    "Statement",
    "content_digest",
    "list_motion_files",
    "read_motion",
    "read_reference",
    "read_sources",
    "refuse_outside_link",
    "sources_in_use",
    "sources_of_environment",
]
