"""Readers: convert motion files of all known formats to clips on the canonical skeleton."""

from pipeline.readers.listing import (
    content_digest,
    list_files,
    list_motion_files,
    read_reference,
    refuse_outside_link,
    source_warnings,
)
from pipeline.readers.match_skeleton import written_map
from pipeline.readers.read_motion import ReadMotion, read_motion
from pipeline.readers.remembered import SourcesInUse, sources_in_use
from pipeline.readers.source import (
    NOTHING_STATED,
    FileStatement,
    Source,
    Statement,
    read_sources,
    sources_of_environment,
)
