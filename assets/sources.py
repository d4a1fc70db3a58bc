"""The external asset `raw_motions`: the source folders, versioned by content."""

from pathlib import Path
from typing import Any

import dagster as dg

from assets.project import Project
from pipeline.files import digest
from pipeline.readers import content_digest, list_files, list_motion_files, source_warnings

RAW_MOTIONS = dg.AssetKey(["raw_motions"])

DATA_VERSION_TAG = "dagster/data_version"
"""Tag of a materialization: its data version."""

raw_motions = dg.AssetSpec(
    RAW_MOTIONS,
    group_name="motions",
    description="The folders of motion files named in data/sources.yaml and in BOOSTER_LAB_MOTIONS, by content.",
    kinds={"file"},
)


def motion_files(project: Project) -> list[tuple[str, Path, str, tuple]]:
    """Every motion file: `(clip name, path, digest of all its clip is read from, (source, path in it))`."""
    files = []
    for source in project.sources():
        paths = list_motion_files(source)
        stems = [path.relative_to(source.folder).with_suffix("").as_posix() for path in paths]
        for path, stem in zip(paths, stems, strict=True):
            within = path.relative_to(source.folder).as_posix()
            name = f"{source.name}/{stem if stems.count(stem) == 1 else within}"
            files.append((name, path, content_digest(path, source), (source, within)))
    return files


def source_notes(project: Project) -> list[str]:
    """What a person should know of the sources: files that are not read, folders and patterns that hold nothing."""
    return [text for source in project.sources() for text in source_warnings(source, list_files(source))]


def motions_version(project: Project) -> tuple[str, dict[str, Any]]:
    """Digest of the source folders' content, and what is noted of them in the history."""
    files = motion_files(project)
    version = digest.of_json([(name, content) for name, _, content, _ in files])
    return version, {"files": len(files), "sources": dg.MetadataValue.md(_source_table(project))}


def _source_table(project: Project) -> str:
    rows = [f"| {each.name} | {each.licence} | {len(list_motion_files(each))} |" for each in project.sources()]
    return "\n".join(["| source | licence | files |", "|---|---|---|", *rows])
