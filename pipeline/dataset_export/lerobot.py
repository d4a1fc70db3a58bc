"""Export to a LeRobotDataset v3.0: many episodes in a few Parquet files, and their metadata.

<folder>/meta/info.json                                robot, rate, features, paths
<folder>/meta/stats.json                               minimum, maximum, mean, deviation and count of each feature
<folder>/meta/tasks.parquet                            one row per task (skill)
<folder>/meta/episodes/chunk-000/file-000.parquet      one row per episode: task, place of its frames, statistics
<folder>/data/chunk-000/file-000.parquet               one row per frame

A clip is an episode and its skill is the task. `action` is the target of a tracking controller: the joint positions of
the next frame (for the last frame, its own). The format is described at https://huggingface.co/docs/lerobot/lerobot-dataset-v3.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.clips.robot_clip import RobotClip

VERSION = "v3.0"
CHUNK_FILES = 1000
"""Maximum number of files per folder `chunk-...`."""
FILE_MB = 100
"""Approximate size of a data file [MB]."""
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
INDICES = ("frame_index", "episode_index", "index", "task_index")
XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")


@dataclass
class Figures:
    """Minimum, maximum, mean and standard deviation of a feature, over all frames that were added."""

    count: int = 0
    low: np.ndarray = field(default_factory=lambda: np.array(np.inf))
    high: np.ndarray = field(default_factory=lambda: np.array(-np.inf))
    total: np.ndarray = field(default_factory=lambda: np.array(0.0))
    squares: np.ndarray = field(default_factory=lambda: np.array(0.0))

    def add(self, values: np.ndarray) -> None:
        """Add frames (t, d)."""
        self.count += len(values)
        self.low, self.high = np.minimum(self.low, values.min(axis=0)), np.maximum(self.high, values.max(axis=0))
        self.total, self.squares = self.total + values.sum(axis=0), self.squares + (values**2).sum(axis=0)

    def to_dict(self) -> dict[str, list[Any]]:
        """The statistics under the names of the format."""
        mean = self.total / self.count
        variance = np.maximum(self.squares / self.count - mean**2, 0.0)
        figures = {"min": self.low, "max": self.high, "mean": mean, "std": np.sqrt(variance)}
        return {name: value.tolist() for name, value in figures.items()} | {"count": [self.count]}


def write_lerobot(folder: Path, clips: Iterable[tuple[RobotClip, str]], file_mb: float = FILE_MB) -> int:
    """Write clips of one robot and rate, each with its skill, into an empty or new folder and return their number."""
    writer: pq.ParquetWriter | None = None
    episodes: list[dict[str, Any]] = []
    tasks: dict[str, int] = {}
    whole: dict[str, Figures] = {}
    features: dict[str, Any] = {}
    robot, fps, frames, number, room = "", 0.0, 0, -1, 0
    try:
        for clip, skill in clips:
            if not features:
                features, robot, fps = features_of(clip), clip.robot, clip.fps
            task = tasks.setdefault(skill, len(tasks))
            columns = _columns(clip, len(episodes), frames, task)
            table = _table(columns, features)
            if writer is None or room < table.nbytes:
                if writer is not None:
                    writer.close()
                number, room = number + 1, int(file_mb * 1e6)
                path = folder / DATA_PATH.format(**_place(number))
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = pq.ParquetWriter(path, table.schema, compression="snappy")
            writer.write_table(table)
            room -= table.nbytes
            episodes.append(_episode(columns, len(episodes), skill, frames, number))
            for name, values in columns.items():
                whole.setdefault(name, Figures()).add(_wide(values))
            frames += clip.frame_count
    finally:
        if writer is not None:
            writer.close()
    _write_meta(folder, episodes, tasks, whole)
    info = _info(robot, fps, features, len(episodes), frames, len(tasks))
    (folder / "meta/info.json").write_text(json.dumps(info, indent=4) + "\n")
    return len(episodes)


def features_of(clip: RobotClip) -> dict[str, Any]:
    """Type, shape and names of each column of a frame."""
    joints = list(clip.joint_names)
    wide = {
        "observation.state": joints,
        "observation.joint_vel": joints,
        "observation.root_pos_w": list(XYZ),
        "observation.root_quat_w": list(WXYZ),
        "observation.root_lin_vel_w": list(XYZ),
        "observation.root_ang_vel_w": list(XYZ),
        "action": joints,
    }
    found = {name: {"dtype": "float32", "shape": [len(names)], "names": names} for name, names in wide.items()}
    found["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    return found | {name: {"dtype": "int64", "shape": [1], "names": None} for name in INDICES}


def _columns(clip: RobotClip, episode: int, first: int, task: int) -> dict[str, np.ndarray]:
    """Values of each column for the frames of a clip."""
    count = clip.frame_count
    order = np.arange(count)
    return {
        "observation.state": clip.joint_pos,
        "observation.joint_vel": clip.joint_vel(),
        "observation.root_pos_w": clip.root_pos_w,
        "observation.root_quat_w": clip.root_quat_w,
        "observation.root_lin_vel_w": clip.root_lin_vel_w(),
        "observation.root_ang_vel_w": clip.root_ang_vel_w(),
        "action": clip.joint_pos[np.minimum(order + 1, count - 1)],
        "timestamp": order / clip.fps,
        "frame_index": order,
        "episode_index": np.full(count, episode),
        "index": first + order,
        "task_index": np.full(count, task),
    }


def _table(columns: dict[str, np.ndarray], features: dict[str, Any]) -> pa.Table:
    arrays = {}
    for name, values in columns.items():
        kind = pa.float32() if features[name]["dtype"] == "float32" else pa.int64()
        flat = pa.array(values.astype(kind.to_pandas_dtype()).reshape(-1), type=kind)
        wide = values.ndim == 2
        arrays[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1]) if wide else flat
    return pa.table(arrays)


def _wide(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1).astype(float)


def _place(number: int) -> dict[str, int]:
    """Indices of the chunk and of the file in it."""
    return {"chunk_index": number // CHUNK_FILES, "file_index": number % CHUNK_FILES}


def _episode(columns: dict[str, np.ndarray], episode: int, skill: str, first: int, number: int) -> dict[str, Any]:
    """A row of the episode table."""
    count = len(columns["index"])
    place = _place(number)
    row: dict[str, Any] = {
        "episode_index": episode,
        "tasks": [skill],
        "length": count,
        "dataset_from_index": first,
        "dataset_to_index": first + count,
        "data/chunk_index": place["chunk_index"],
        "data/file_index": place["file_index"],
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    for name, values in columns.items():
        figures = Figures()
        figures.add(_wide(values))
        row |= {f"stats/{name}/{key}": value for key, value in figures.to_dict().items()}
    return row


def _write_meta(folder: Path, episodes: list[dict[str, Any]], tasks: dict[str, int], whole: dict[str, Figures]) -> None:
    """Episodes, tasks and figures of all frames."""
    path = folder / EPISODES_PATH
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.Table.from_pylist(episodes), path, compression="snappy")
    names = pd.DataFrame({"task_index": list(tasks.values())}, index=pd.Index(list(tasks), name="task", dtype="object"))
    names.to_parquet(folder / "meta/tasks.parquet")
    figures = {name: each.to_dict() for name, each in whole.items()}
    (folder / "meta/stats.json").write_text(json.dumps(figures, indent=4, allow_nan=False) + "\n")


def _info(robot: str, fps: float, features: dict[str, Any], episodes: int, frames: int, tasks: int) -> dict[str, Any]:
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": CHUNK_FILES,
        "data_files_size_in_mb": FILE_MB,
        "video_files_size_in_mb": 200,
        "fps": round(fps),
        "splits": {"train": f"0:{episodes}"},
        "data_path": DATA_PATH,
        "video_path": None,
        "features": {name: {**feature, "fps": round(fps)} for name, feature in features.items()},
    }
