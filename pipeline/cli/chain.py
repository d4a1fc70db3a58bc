"""Run the stages on one file or clip outside of the graph: reading, repair, retargeting."""

import contextlib
import dataclasses
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pipeline.catalog import CatalogSettings, catalogue
from pipeline.clips.outcome import Clip, Outcome, Piece, Reason
from pipeline.errors import FileError
from pipeline.project import Project
from pipeline.quality.planar_motion import planar_motion
from pipeline.readers import ReadMotion, Source, Statement, read_motion
from pipeline.repair import RepairSettings
from pipeline.repair import process as repair
from pipeline.retarget import RetargetSettings
from pipeline.retarget.process import onto_robot
from pipeline.robot import Robot
from pipeline.selection import TRANSITION, Curation
from pipeline.selection import process as select

OPTIONS = {key: f"--{key}" for key in ("unit", "up", "skeleton", "asf", "quaternion")} | {"fps": "--source-fps"}
"""Key of data/sources.yaml -> command line option with the same meaning."""


def with_options(advice: str, options: Mapping[str, str] = OPTIONS) -> str:
    """Append to advice the options that correspond to the keys of data/sources.yaml in it."""
    keys = dict.fromkeys(re.findall(r"`(\w+):", advice))
    named = ", ".join(options[key] for key in keys if key in options)
    return f"{advice.rstrip('.')}. For this command only: {named}." if named else advice


@contextlib.contextmanager
def naming_options(options: Mapping[str, str] = OPTIONS) -> Iterator[None]:
    """Add command line options to FileErrors of readers, which only name keys of data/sources.yaml."""
    try:
        yield
    except FileError as error:
        error.do = with_options(error.do, options)
        error.args = (with_options(str(error), options),)
        raise


@dataclass(frozen=True, kw_only=True)
class FileRead:
    """A motion file that was read."""

    path: Path
    """Absolute."""
    source: Source
    """Its source, with the properties stated on the command line."""
    motion: ReadMotion


@dataclass(frozen=True)
class Chain:
    """The stages with the settings of a project; a settings file is read on first use."""

    project: Project

    def read(self, path: Path, stated: Statement) -> FileRead:
        """Read a motion file. Raises FileError."""
        if not path.is_file():
            raise FileError(path, "it is not a file." if path.exists() else "the file does not exist.")
        path = path.resolve()
        source = self.project.source_of(path, stated)
        within = path.relative_to(source.folder).with_suffix("").as_posix()
        with naming_options():
            motion = read_motion(path, f"{source.name}/{within}", source.statement_of(path))
        motion = dataclasses.replace(motion, notes=(*motion.notes, *source.notes_of(path)))
        return FileRead(path=path, source=source, motion=motion)

    def catalogued(self, read: FileRead) -> Outcome:
        """The catalogued clip of a file, with its numbers and defects of the whole file corrected."""
        rate_is_stated = read.source.statement_of(read.path).fps is not None
        return catalogue(read.motion, settings=self._catalog, rate_is_stated=rate_is_stated)

    def windows(self, piece: Piece) -> Outcome:
        """The windows of one skill of a catalogued clip."""
        return select(piece.clip, piece.numbers, settings=self._curation)

    def repaired(self, piece: Piece) -> Outcome:
        """Repair a whole catalogued clip as one window."""
        window = {"skill": TRANSITION, "start_frame": 0, "stop_frame": piece.clip.frame_count}
        return repair(piece.clip, {**piece.numbers, **window}, settings=self._repair)

    def repaired_window(self, window: Piece) -> Outcome:
        """Repair a window of one skill of a catalogued clip."""
        return repair(window.clip, window.numbers, settings=self._repair)

    def retargeted(self, piece: Piece, numbers: Mapping[str, Any], robot: Robot) -> Outcome:
        """Retarget a repaired piece onto a robot; a recording of this robot is kept unchanged."""
        return onto_robot(piece.clip, {**numbers, **piece.numbers}, settings=self._retarget, robot=robot)

    def speeds(self, clip: Clip) -> Float[np.ndarray, " n"]:
        """Horizontal speed of the root [m/s] in the frames where it is known, smoothed as for the windows."""
        windows = self._curation.windows
        motion = planar_motion(clip, windows.velocity_s, windows.facing_s, windows.bridge_s)
        return motion.speed[motion.valid]

    _catalog = cached_property(lambda self: self.project.read("catalog.yaml", CatalogSettings))
    _curation = cached_property(lambda self: self.project.read("curation.yaml", Curation))
    _repair = cached_property(lambda self: self.project.read("repair.yaml", RepairSettings))
    _retarget = cached_property(lambda self: self.project.read("retarget.yaml", RetargetSettings))


def reason_line(reason: Reason) -> str:
    """`repaired  1.20 to 1.50 s  <text>`, without the times for the whole clip."""
    times = ""
    if reason.start_s is not None:
        stop = "" if reason.stop_s is None else f" to {reason.stop_s:.2f}"
        times = f"{reason.start_s:.2f}{stop} s: "
    return f"{reason.effect:9}{times}{reason.text}"
