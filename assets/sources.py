"""The external asset `raw_motions`: the source folders, versioned by content."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dagster as dg

from assets.plan import digest_of_robots, external
from pipeline.files import digest
from pipeline.files.shown_text import markdown_table
from pipeline.project import Project
from pipeline.readers import SourcesInUse, content_digest, list_files, list_motion_files, source_warnings
from pipeline.readers.read_motion import may_be_of_a_robot
from pipeline.readers.remembered import VARIABLE, check_sources, remember

RAW_MOTIONS = dg.AssetKey(["raw_motions"])

DATA_VERSION_TAG = "dagster/data_version"
"""Tag of a materialization: its data version."""

SOURCES_NAME = "motion_sources"
SOURCES = dg.DynamicPartitionsDefinition(name=SOURCES_NAME)
"""One partition per source of motions; a shard of a manifest belongs to one source."""

FOLDERS = "The motion folders named in data/sources.yaml and in BOOSTER_LAB_MOTIONS, versioned by content."
raw_motions = external("raw_motions", None, FOLDERS)


@dataclass(frozen=True, kw_only=True)
class Motions:
    """The current motion files of all sources."""

    project: Project
    sources: SourcesInUse
    paths: Mapping[str, list[Path]]
    """Name of a source -> its motion files."""

    @property
    def counts(self) -> dict[str, int]:
        """Name of a source -> number of its motion files."""
        return {name: len(paths) for name, paths in self.paths.items()}

    def files(self) -> list[tuple[str, Path, str, tuple]]:
        """Every motion file: `(clip name, path, digest of all its inputs, (source, path in it))`.

        The inputs of a file that may hold a robot's motion include the folders of all robots.
        """
        files, robots = [], digest_of_robots(self.project)
        for source in self.sources.all:
            paths = self.paths[source.name]
            stems = [path.relative_to(source.folder).with_suffix("").as_posix() for path in paths]
            count = Counter(stems)
            for path, stem in zip(paths, stems, strict=True):
                within = path.relative_to(source.folder).as_posix()
                name = f"{source.name}/{stem if count[stem] == 1 else within}"
                content = content_digest(path, source)
                if may_be_of_a_robot(path):
                    content = digest.of_json([content, robots])
                files.append((name, path, content, (source, within)))
        return files

    def warnings(self) -> list[str]:
        """A message for each source that only an earlier run named."""
        return [
            f"source '{source.name}' ({source.folder}, {len(self.paths[source.name])} motion files) is used because an "
            f"earlier run used it; {VARIABLE} does not name it now. Add it to data/sources.yaml to keep it, or remove "
            f"its clips: booster-lab sources forget {source.name}"
            for source in self.sources.remembered
        ]


def find_motions(project: Project) -> Motions:
    """Find the motion files of all sources. Raises SourceLostError if a source of an earlier run is gone."""
    sources = project.sources()
    paths = {source.name: list_motion_files(source) for source in sources.all}
    found = Motions(project=project, sources=sources, paths=paths)
    check_sources(project.remembered_sources, sources, found.counts)
    return found


def remember_sources(project: Project, motions: Motions) -> None:
    """Record the sources in the store, so that a later run without one of them fails."""
    remember(project.remembered_sources, motions.sources, motions.counts)


def note_sources(instance: dg.DagsterInstance, names: Sequence[str]) -> None:
    """Make the partitions of `SOURCES` equal to the given source names."""
    known = instance.get_dynamic_partitions(SOURCES_NAME)
    if new := [name for name in names if name not in known]:
        instance.add_dynamic_partitions(SOURCES_NAME, new)
    for name in set(known) - set(names):
        instance.delete_dynamic_partition(SOURCES_NAME, name)


def source_notes(project: Project) -> list[str]:
    """Warnings on the sources: files that are not read, empty folders, patterns without a match."""
    return [text for source in project.sources().all for text in source_warnings(source, list_files(source))]


def motions_version(project: Project) -> tuple[str, dict[str, Any]]:
    """Digest of the content of the source folders, and the metadata that Dagster's history records with it."""
    motions = find_motions(project)
    files = motions.files()
    version = digest.of_json([(name, content) for name, _, content, _ in files])
    rows = [(source.name, source.licence, len(motions.paths[source.name])) for source in motions.sources.all]
    table = markdown_table(("source", "licence", "files"), rows)
    return version, {"files": len(files), "sources": dg.MetadataValue.md(table)}
