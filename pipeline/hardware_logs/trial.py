"""A trial: one continuous recording of a robot on a regular time grid, and its Parquet format.

Sensor arrays are float32, as in the messages, so nothing is lost and ten minutes of a T1 are small.
"""

import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from jaxtyping import Float, Int

from pipeline.errors import FileError
from pipeline.hardware_logs.missed_bars import MissedBar
from pipeline.hardware_logs.robot_log import OperatorEvent

FORMAT = "booster-lab trial 1"

ROUNDING_S = 1e-7
"""Tolerance of times, far below the sampling period [s]."""


@dataclass(frozen=True, kw_only=True)
class Gap:
    """A time range without samples: floats are NaN there, discrete values keep their last value."""

    start_s: float
    stop_s: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class Trial:
    """n samples of j joints. Before the first message of a topic its floats are NaN and its discrete values -1."""

    name: str
    """Path of the log below the folder of logs without suffix; `+2` and so on if a log has several trials."""
    robot: str
    joint_names: tuple[str, ...]
    """Joints in the robot's order, which all arrays with j columns have."""
    policy_digest: str | None
    """SHA-256 of the policy; None if unknown."""
    command_source: str
    """One of `robot_log.COMMAND_SOURCES`."""
    simulated: bool
    integrity: str
    """`complete`: all of the log was read and its checksums are correct; `recovered`: parts were lost and the rest is
    correct; `unverified`: it has no checksums."""
    rate_hz: float
    start_ns: int
    """Receipt time of the first sample since 1970, a multiple of the period [ns]."""
    log_digest: str
    """SHA-256 of the log file."""
    notes: tuple[str, ...]
    """Findings, one line each: losses, and irregularities that do not reject the log."""
    events: tuple[OperatorEvent, ...]
    gaps: tuple[Gap, ...]
    missed: tuple[MissedBar, ...] = ()
    """Missed bars of a validation's simulated trial."""

    time_s: Float[np.ndarray, " n"]
    """Regular, from 0; float64."""
    joint_pos: Float[np.ndarray, "n j"]
    """[rad]"""
    joint_vel: Float[np.ndarray, "n j"]
    """[rad/s]"""
    torque_est: Float[np.ndarray, "n j"]
    """[N m]"""
    temperature_c: Float[np.ndarray, "n j"]
    lost: Int[np.ndarray, "n j"]
    """Packets lost since the motors started."""
    rpy: Float[np.ndarray, "n 3"]
    """Trunk in the world, R = Rz(yaw) Ry(pitch) Rx(roll) [rad]; roll and yaw are in -pi to pi."""
    gyro_b: Float[np.ndarray, "n 3"]
    """[rad/s]"""
    acc_b: Float[np.ndarray, "n 3"]
    """Specific force [m/s^2]."""
    target_pos: Float[np.ndarray, "n j"]
    """Joint targets of `/joint_ctrl`, held [rad]."""
    target_torque: Float[np.ndarray, "n j"]
    """Feed-forward [N m], held."""
    kp: Float[np.ndarray, "n j"]
    """[N m/rad], held."""
    kd: Float[np.ndarray, "n j"]
    """[N m s/rad], held."""
    fall_state: Int[np.ndarray, " n"]
    """0 ready, 1 falling, 2 has fallen, 3 getting up; held."""
    odometer: Float[np.ndarray, "n 3"]
    """x, y [m], theta [rad] as the robot estimates it, held."""
    command: Float[np.ndarray, "n 3"]
    """Forward and left velocity [m/s] and yaw rate [rad/s] commanded, held between messages."""

    @property
    def seconds(self) -> float:
        """Duration [s], gaps included."""
        return len(self.time_s) / self.rate_hz

    @property
    def gravity_b(self) -> Float[np.ndarray, "n 3"]:
        """Direction of gravity in the trunk's frame, unit length: (0, 0, -1) when upright."""
        roll, pitch = self.rpy[:, 0], self.rpy[:, 1]
        return np.stack([np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)], axis=1)

    @property
    def measured(self) -> np.ndarray:
        """Mask of samples outside gaps (n,)."""
        inside = np.zeros(len(self.time_s), dtype=bool)
        for gap in self.gaps:
            inside |= (self.time_s > gap.start_s + ROUNDING_S) & (self.time_s < gap.stop_s - ROUNDING_S)
        return ~inside


ARRAYS = (
    *("time_s", "joint_pos", "joint_vel", "torque_est", "temperature_c", "lost", "rpy", "gyro_b", "acc_b"),
    *("target_pos", "target_torque", "kp", "kd", "fall_state", "odometer", "command"),
)
"""Fields of a trial stored as columns; the others are in the file's metadata."""
WHOLE = ("lost", "fall_state")
"""Integer columns."""


class TrialWriter:
    """Incremental writer of a trial's Parquet file, a context manager: without `finish` the file is removed."""

    def __init__(self, path: Path):
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, aside = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
        os.close(handle)
        self._aside, self._writer = Path(aside), None

    def __enter__(self) -> "TrialWriter":
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()
        self._aside.unlink(missing_ok=True)

    def add(self, arrays: dict[str, np.ndarray]) -> None:
        """Append samples, with all arrays of `ARRAYS`."""
        table = pa.table({name: _to_column(name, arrays[name]) for name in ARRAYS})
        if self._writer is None:
            self._writer = pq.ParquetWriter(
                self._aside, table.schema, compression="zstd", use_dictionary=False, write_statistics=False
            )
        self._writer.write_table(table)

    def finish(self, head: dict[str, Any]) -> None:
        """Write the metadata and move the file to its final name."""
        assert self._writer is not None, "a trial has samples"
        text = json.dumps({"format": FORMAT, **head}, sort_keys=True, allow_nan=False)
        self._writer.add_key_value_metadata({"booster_lab": text})
        self._writer.close()
        self._writer = None
        with self._aside.open("rb") as stream:
            os.fsync(stream.fileno())
        self._aside.chmod(0o644)
        self._aside.replace(self.path)


def read_trial(path: Path) -> Trial:
    """Read a trial. Raises FileError."""
    try:
        with pq.ParquetFile(path) as file:  # read_table would import pyarrow.dataset; threads need more memory
            table, head = file.read(use_threads=False), json.loads(file.metadata.metadata[b"booster_lab"])
        arrays: dict[str, Any] = {name: _from_column(table.column(name)) for name in ARRAYS}
    except (pa.ArrowException, OSError, KeyError, TypeError, ValueError) as error:
        raise FileError(path, f"not a trial ({error}).", "Materialize hardware_trials again.") from error
    if head.pop("format", None) != FORMAT:
        raise FileError(path, f"not a trial of format {FORMAT!r}.", "Materialize hardware_trials again.")
    head["joint_names"], head["notes"] = tuple(head["joint_names"]), tuple(head["notes"])
    head["events"] = tuple(OperatorEvent(**event) for event in head["events"])
    head["gaps"] = tuple(Gap(**gap) for gap in head["gaps"])
    head["missed"] = tuple(MissedBar(**each) for each in head.get("missed", ()))
    return Trial(**head, **arrays)


def _to_column(name: str, values: np.ndarray) -> pa.Array:
    if values.ndim == 1:
        return _plain(np.ascontiguousarray(values, dtype=np.int64 if name in WHOLE else np.float64))
    flat = np.ascontiguousarray(values, dtype=np.int64 if name in WHOLE else np.float32)
    return pa.FixedSizeListArray.from_arrays(_plain(flat.ravel()), flat.shape[1])


def _plain(values: np.ndarray) -> pa.Array:
    """Convert without a copy; `pa.array` would import pandas (30 MB) for a type check."""
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, pa.py_buffer(values)])


def _from_column(column: pa.ChunkedArray) -> np.ndarray:
    """Convert a column by DLPack; `to_numpy` would import pandas. Raises pa.ArrowInvalid for nulls."""
    wide = pa.types.is_fixed_size_list(column.type)
    chunks = [np.from_dlpack(_inner(chunk) if wide else chunk) for chunk in column.chunks if len(chunk)]
    flat = np.concatenate(chunks) if chunks else np.zeros(0)
    return flat.reshape(-1, column.type.list_size) if wide else flat


def _inner(lists: pa.FixedSizeListArray) -> pa.Array:
    """Concatenated values of all lists; `flatten` would import pyarrow.compute (13 MB)."""
    if lists.null_count:
        raise pa.ArrowInvalid("has lists that are null")
    size = lists.type.list_size
    return lists.values.slice(lists.offset * size, len(lists) * size)
