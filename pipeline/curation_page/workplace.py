"""State of a project for the server: clip table (read again after a change), thumbnails, decisions, runs."""

import contextlib
import json
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.batch import ClipPool
from pipeline.curation_page.clip_details import clip_details
from pipeline.curation_page.clip_table import (
    DATABASE,
    LAST,
    STAGES,
    ClipTable,
    NoClipError,
    asset_of,
    made_from,
    read_table,
)
from pipeline.curation_page.columns import THRESHOLD_COLUMNS, columns
from pipeline.curation_page.compare_databases import compare, versions
from pipeline.curation_page.line_figure import encode
from pipeline.curation_page.materialization import Materialization, Rerun, rerun_of
from pipeline.curation_page.motion_sources import MotionSources
from pipeline.curation_page.thumbnails import ThumbnailStore
from pipeline.errors import FileError, PipelineError, UnknownNameError
from pipeline.feasibility import criteria_table
from pipeline.feedback.approve import PROPOSAL_ASSET
from pipeline.files import digest, settings
from pipeline.project import Project
from pipeline.selection.curation import Decision, decide, read_decisions, take_back
from pipeline.viewing.playlist import MotionSource

FIRST_SCREEN = 24
"""Number of clips on the first screen."""


@dataclass(frozen=True, kw_only=True)
class _Snapshot:
    """Data read from the manifests of one version."""

    version: str
    table: ClipTable
    sources: MotionSources
    manifest: Path
    """Path of KP5's manifest; the criteria table is beside it."""

    @cached_property
    def criteria(self) -> pd.DataFrame | None:
        """KP5's criteria table, read on first use; None if it does not belong to the manifest."""
        return self._criteria(None)

    @cached_property
    def thresholds(self) -> pd.DataFrame | None:
        """The columns of the criteria table for the gallery."""
        return self._criteria(THRESHOLD_COLUMNS)

    def _criteria(self, columns: tuple[str, ...] | None) -> pd.DataFrame | None:
        if LAST not in self.table.manifests:
            return None
        try:
            return criteria_table.read(criteria_table.path_beside(self.manifest), self.manifest, columns=columns)
        except FileError:
            return None


class Workplace:
    """A project and the robot whose clips are curated.

    Args:
        root: folder of the project
        robot: name of a folder in `robots/`
        pool: processes for thumbnails
    """

    def __init__(self, root: Path, robot: str, pool: ClipPool | None = None) -> None:
        self.project, self.robot_name = Project(root), robot
        self.robot, self.store = self.project.robot(robot), self.project.store
        self.curation = self.project.settings("curation.yaml")
        self.database = self.project.expert_db(robot)
        self._pool = pool or ClipPool()
        self._lock = threading.Lock()
        self._read: _Snapshot | None = None
        self._clips: tuple[tuple[str, tuple[Decision, ...]], bytes] | None = None

    @cached_property
    def thumbnails(self) -> ThumbnailStore:
        folder = self.project.robot_folder(self.robot_name)
        return ThumbnailStore(store=self.store, robot_folder=folder, robot_digest=self.robot.digest, pool=self._pool)

    def version(self) -> str:
        """Version of the manifests; changes when one is written."""
        return _version(self.store.manifest_path(asset_of(stage, self.robot_name)) for stage in STAGES)

    def answers_version(self) -> str:
        """Version of decisions, proposal and answers; changes when any program writes one."""
        files = self.project.feedback
        proposal = self.store.manifest_path(PROPOSAL_ASSET)
        return _version((self.curation, proposal, files.approved, files.declined))

    def read(self) -> _Snapshot:
        """The current table; read again if a manifest changed. Raises FileError."""
        with self._lock:
            version = self.version()
            if self._read is None or self._read.version != version:
                table = read_table(self.store, self.robot_name)
                manifest = self.store.manifest_path(asset_of(LAST, self.robot_name))
                self._read = _Snapshot(version=version, table=table, sources=MotionSources(table), manifest=manifest)
            return self._read

    def decisions(self) -> tuple[Decision, ...]:
        return read_decisions(self.curation)

    def clips(self) -> bytes:
        """The clip table as JSON, with the key of each thumbnail."""
        snapshot, decisions = self.read(), self.decisions()
        state = (snapshot.version, decisions)
        with self._lock:
            if self._clips is not None and self._clips[0] == state:
                return self._clips[1]
        keys = [self.thumbnails.key(snapshot.sources.of(row)) for row in snapshot.table.rows]
        found = {
            "version": snapshot.version,
            "robot": self.robot_name,
            "database": asset_of(DATABASE, self.robot_name),
            "thumbnail": keys,
            **columns(snapshot.table, snapshot.thresholds, decisions),
        }
        made = json.dumps(found, allow_nan=False, separators=(",", ":")).encode()
        with self._lock:
            self._clips = (state, made)
        return made

    def clip(self, name: str) -> dict[str, Any]:
        """Details of one clip. Raises NoClipError."""
        snapshot = self.read()
        return clip_details(snapshot.table, snapshot.criteria, self.decisions(), self.robot_name, name)

    def motion(self, name: str) -> bytes:
        """The encoded motions of one clip. Raises NoClipError, FileError, ClipError."""
        snapshot = self.read()
        row = snapshot.table.row(name)
        if row is None:
            raise NoClipError(name)
        return encode(snapshot.sources.of(row).load(self.store, self.robot).figures())

    def release_report(self, robot: str) -> Path | None:
        """Path of a robot's release report; None if there is none. Raises UnknownNameError."""
        if robot not in self.project.robots:
            raise UnknownNameError("robot", robot, self.project.robots)
        path = self.project.release_report(robot)
        return path if path.is_file() else None

    def thumbnail(self, key: str) -> bytes | None:
        """A thumbnail of a current clip by its key; None if no clip has it."""
        path = self.thumbnails.path(key)
        if path.is_file():
            return path.read_bytes()
        source = self.thumbnail_sources()[0].get(key)
        return None if source is None else self.thumbnails.make(source)

    def make_first_thumbnails(self) -> None:
        """Make the missing thumbnails of the first screen in this process."""
        snapshot = self.read()
        for row in snapshot.table.rows[:FIRST_SCREEN]:
            self.thumbnails.make(snapshot.sources.of(row))

    def thumbnail_sources(self) -> tuple[dict[str, MotionSource], ThumbnailStore]:
        """Key -> source of all thumbnails, and their store."""
        snapshot = self.read()
        sources = [snapshot.sources.of(row) for row in snapshot.table.rows]
        return {self.thumbnails.key(source): source for source in sources}, self.thumbnails

    def decide(self, clips: list[str], verdict: str, by: str, why: str) -> int:
        """Write a decision on clips and return their number. Raises NoClipError, SettingsError, FileError.

        Args:
            clips: names of clips, windows or recordings
            verdict: `accept` or `exclude`
            by: name of the person
            why: reason
        """
        table = self.read().table
        known = {part for row in table.rows for part in (row.clip, *row.pieces)}
        known |= {name for clip in known for name in made_from(clip)}
        unknown = [clip for clip in clips if clip not in known]
        if unknown or not clips:
            raise NoClipError(unknown[0] if unknown else "")
        day = date.today().isoformat()
        made = [{"clip": clip, "verdict": verdict, "by": by, "why": why, "day": day} for clip in clips]
        decide(self.curation, [settings.parse(Decision, each, self.curation) for each in made])
        return len(clips)

    def take_back(self, clips: list[str]) -> int:
        """Remove the decisions on clips and return the number of clips. Raises FileError."""
        take_back(self.curation, clips)
        return len(clips)

    def versions(self) -> list[dict[str, Any]]:
        """Versions of the database that can be compared."""
        return [{"name": each.name, "clips": each.clips, "seconds": each.seconds} for each in versions(self.database)]

    def compare(self, before: str, after: str) -> dict[str, Any]:
        """Compare two versions of the database. Raises UnknownNameError, FileError."""
        return compare(self.database, before, after, self.read().table, self.decisions())


def _version(paths: Iterable[Path]) -> str:
    """Digest of names, times and sizes of files; changes when one is written, made or removed."""
    found = []
    for path in paths:
        with contextlib.suppress(FileNotFoundError):
            facts = path.stat()
            found.append((path.name, facts.st_mtime_ns, facts.st_size))
    return digest.of_json(found)[:16]


class Runs:
    """Runs that the page starts, one at a time. `state` may be called from any thread."""

    def __init__(self, workplace: Workplace) -> None:
        self._workplace = workplace
        self._run = Materialization(workplace.project.root)
        self._lock = threading.Lock()
        self._rerun: Rerun | None = None
        self._outcome: dict[str, Any] | None = None

    def start(self) -> int:
        """Materialize the database and stale upstream assets. Raises PipelineError if a run is in progress."""
        with self._lock:
            self._run.start(asset_of(DATABASE, self._workplace.robot_name))
            self._rerun, self._outcome = None, None
        return 1

    def start_again(self, clips: list[str]) -> int:
        """Process clips again, from recording to database, and return their number. Raises PipelineError."""
        workplace = self._workplace
        rerun = rerun_of(workplace.read().table, clips, workplace.robot_name)
        with self._lock:
            self._run.start(*rerun.assets, again=rerun.names)
            self._rerun, self._outcome = rerun, None
        return len(rerun.before)

    def stop(self) -> None:
        """Terminate the run, if one is in progress."""
        self._run.stop()

    def state(self) -> dict[str, Any]:
        """State of the run; `rerun` is the outcome of a finished rerun, or the number of clips of a running one."""
        with self._lock:
            state = self._run.state()
            if self._rerun is None:
                return {**state, "rerun": None}
            if self._outcome is None and not state["at_work"]:
                try:
                    self._outcome = self._rerun.outcome(self._workplace.read().table)
                except PipelineError as error:
                    self._outcome = {"clips": len(self._rerun.before), "error": str(error)}
            return {**state, "rerun": self._outcome or {"clips": len(self._rerun.before)}}
