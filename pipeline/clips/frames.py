"""What all clips do with their frames: take a part of them, and go to another rate."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from typing import Any, TypeVar

import numpy as np

from pipeline import time_series

Own = TypeVar("Own", bound="Frames")


class Frames(ABC):
    """Base of the frozen dataclasses of clips: `fps`, `frame_count`, and arrays of one row a frame.

    Booleans are labels; names with `quat` are rotations; other arrays are quantities. A nested object with a method
    `cut` (simulated forces) belongs to its own rate.
    """

    fps: float
    """Frames per second [Hz]."""

    @property
    @abstractmethod
    def frame_count(self) -> int:
        """Number of frames."""

    @property
    def duration_s(self) -> float:
        return self.frame_count / self.fps

    def cut(self: Own, start: int, stop: int, name: str) -> Own:
        """Frames [start, stop) under a new name."""
        parts = {key: value[start:stop].copy() for key, value in vars(self).items() if isinstance(value, np.ndarray)}
        nested = {key: value.cut(start, stop) for key, value in vars(self).items() if hasattr(value, "cut")}
        return self._with(name=name, **parts, **nested)

    def resampled(self: Own, fps: float) -> Own:
        """The same motion at another rate, by time: quantities linearly, rotations by slerp, labels from the nearest
        frame. Simulated forces are dropped."""
        if fps == self.fps:
            return self
        times_s = time_series.resample_times(self.frame_count, self.fps, fps)
        changed: dict[str, Any] = {key: None for key, value in vars(self).items() if hasattr(value, "cut")}
        for key, value in vars(self).items():
            if isinstance(value, np.ndarray):
                labels, rotations = value.dtype == bool, "quat" in key
                method = time_series.resample_quat if rotations else time_series.resample_linear
                changed[key] = (time_series.resample_nearest if labels else method)(value, self.fps, times_s)
        return self._with(fps=fps, **changed)

    def _with(self: Own, **changed: Any) -> Own:
        return dataclasses.replace(self, **changed)  # pyright: ignore[reportArgumentType, reportType]
