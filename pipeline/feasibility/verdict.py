"""What one criterion says of a motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool

from pipeline import time_series
from pipeline.clips.outcome import Reason


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """A number held against its limit."""

    code: str
    """Name of the criterion and of its number: `joint_limit_excess`."""
    value: float
    limit: float
    unit: str
    text: str
    """What was measured and where, as a sentence without the limit."""
    lower: bool = False
    """The limit is the lowest value allowed, not the highest."""
    bad: Bool[np.ndarray, " t"] | None = field(default=None, repr=False)
    """Frames to cut away so that the rest may hold; None where no frames are to blame."""

    @property
    def holds(self) -> bool:
        return self.value >= self.limit if self.lower else self.value <= self.limit

    def reason(self, fps: float, start_s: float, stop_s: float) -> Reason:
        """Why a stretch from `start_s` to `stop_s` [s] of a clip does not go on, or not as a whole."""
        spans = time_series.runs(self.bad) if self.bad is not None else []
        if spans:
            start_s, stop_s = start_s + spans[0][0] / fps, start_s + spans[-1][1] / fps
        allowed = f"{'at least' if self.lower else 'at most'} {self.limit:.3g} {self.unit}".rstrip()
        return Reason(
            code=self.code,
            text=f"{self.text}; {allowed} is allowed.",
            effect="rejected",
            start_s=start_s,
            stop_s=stop_s,
            value=self.value,
            limit=self.limit,
            unit=self.unit,
        )
