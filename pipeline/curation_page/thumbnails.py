"""Thumbnails: two seconds of the human and robot motion of a clip, cached under the digest of their content.

The cache is `data/store/thumbnails/`. It can be deleted; the thumbnails are then made again.
"""

import dataclasses
import functools
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline.batch import ClipPool, Store
from pipeline.curation_page.line_figure import encode
from pipeline.errors import ClipError, FileError
from pipeline.files import atomic, digest
from pipeline.robot import Robot, load_robot
from pipeline.viewing.figure import Figure
from pipeline.viewing.playlist import MotionSource

FORMAT = "booster-lab thumbnail 1"
"""Version of the format, part of every key."""

LOOP_S = 2.0
"""Duration of a thumbnail [s]."""
FPS = 10.0
"""Approximate frame rate of a thumbnail [Hz]."""
CLIPS_PER_CALL = 16
"""Number of thumbnails per call of a worker process."""


@dataclass(frozen=True, kw_only=True)
class ThumbnailStore:
    """The thumbnails of one robot's clips."""

    store: Store
    robot_folder: Path
    robot_digest: str
    pool: ClipPool = field(default_factory=ClipPool)

    @property
    def folder(self) -> Path:
        return self.store.root / "thumbnails"

    def key(self, source: MotionSource) -> str:
        """Key of a source's thumbnail: the digest of its content."""
        human = vars(source.human) if source.human else None
        shown = {**vars(source), "human": human, "clip": None}
        return digest.of_json([FORMAT, self.robot_digest, shown])[:32]

    def path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.bin"

    def make(self, source: MotionSource) -> bytes:
        """The thumbnail of a source, made if it is missing. Empty if there is nothing to draw."""
        path = self.path(self.key(source))
        if path.is_file():
            return path.read_bytes()
        _make_all(self.store, self.robot_folder, [(source, path)])
        return path.read_bytes() if path.is_file() else b""

    def make_missing(self, sources: Mapping[str, MotionSource], stop: threading.Event) -> Iterator[int]:
        """Make missing thumbnails in parallel and yield the number of existing ones after each step.

        Args:
            sources: key -> source of each thumbnail
            stop: ends the work early when set
        """
        todo = [(source, self.path(key)) for key, source in sources.items() if not self.path(key).is_file()]
        done = len(sources) - len(todo)
        yield done
        groups = [todo[start : start + CLIPS_PER_CALL] for start in range(0, len(todo), CLIPS_PER_CALL)]
        calls = [(self.store, self.robot_folder, group) for group in groups]
        for count in self.pool.map(_make_all, calls):
            done += count
            yield done
            if stop.is_set():
                return


def _make_all(store: Store, robot_folder: Path, todo: Sequence[tuple[MotionSource, Path]]) -> int:
    """Make thumbnails and return the number of attempts. A clip that can't be drawn gets an empty file.

    A clip whose stored motion is unreadable gets no file, because the next run restores the motion.
    """
    robot = _robot(robot_folder)
    for source, path in todo:
        try:
            data = thumbnail(store, robot, source)
        except ClipError:
            data = b""
        except FileError:
            continue
        atomic.write_unsynced(path, data)
    return len(todo)


@functools.lru_cache(maxsize=4)
def _robot(folder: Path) -> Robot:
    return load_robot(folder)


def thumbnail(store: Store, robot: Robot, source: MotionSource) -> bytes:
    """Encode `LOOP_S` from the middle of a clip, human and robot at the same times; empty without a motion."""
    shown = dataclasses.replace(source.load(store, robot), reference=None)
    clips = [clip for clip in (shown.human, shown.robot_clip) if clip is not None]
    if not clips:
        return b""
    length_s = max(clip.duration_s for clip in clips)
    start_s = max((length_s - LOOP_S) / 2.0, 0.0)
    start_s, stop_s = start_s, min(start_s + LOOP_S, length_s)
    cut = {
        name: clip.cut(*_frames(clip, start_s, stop_s), clip.name)
        for name, clip in (("human", shown.human), ("robot_clip", shown.robot_clip))
        if clip is not None
    }
    figures = dataclasses.replace(shown, **cut).figures()
    return encode(figures, [_frame_indices(figure) for figure in figures])


def _frames(clip: object, start_s: float, stop_s: float) -> tuple[int, int]:
    """First and last frame (exclusive) of a clip between two times; at least one."""
    fps, count = clip.fps, clip.frame_count  # pyright: ignore[reportAttributeAccessIssue]
    start = min(round(start_s * fps), count - 1)
    return start, max(min(round(stop_s * fps), count), start + 1)


def _frame_indices(figure: Figure) -> np.ndarray:
    """Indices of frames at about `FPS`."""
    return np.arange(0, figure.frame_count, max(round(figure.fps / FPS), 1))
