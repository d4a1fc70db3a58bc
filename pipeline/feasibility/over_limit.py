"""How much of a motion is over a limit, joint by joint: share of a joint's frames and longest time in a row.

Never "any joint in a frame": of twenty joints that each pass a limit for a moment in each stride, one does in most
frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.feasibility.motion import Motion


@dataclass(frozen=True, kw_only=True)
class OverLimit:
    """What joints of a motion are over their limits, and when."""

    share: Float[np.ndarray, " j"]
    """Share of each joint's frames."""
    longest_s: float
    """Longest time in a row of any joint [s] ..."""
    start_s: float
    """... where it begins [s] ..."""
    joint: int
    """... and whose it is."""
    over: Bool[np.ndarray, "t j"]
    fps: float

    @property
    def worst(self) -> int:
        """The joint with the largest share."""
        return int(np.argmax(self.share))

    def frames_of_joints_over(self, share: float) -> Bool[np.ndarray, " t"]:
        """Frames in which a joint whose share is above `share` is over its limit."""
        return np.any(self.over[:, self.share > share], axis=1)

    def frames_of_runs_over(self, run_s: float) -> Bool[np.ndarray, " t"]:
        """Frames in runs that are longer than `run_s`."""
        bad = np.zeros(len(self.over), dtype=bool)
        for _, start, stop in _runs(self.over):
            bad[start:stop] |= (stop - start) / self.fps > run_s
        return bad


def over_limit(over: Bool[np.ndarray, "t j"], motion: Motion) -> OverLimit:
    """What the frames in which joints are over a limit amount to."""
    fps, share = motion.clip.fps, np.mean(over, axis=0)
    longest = max(_runs(over), key=lambda run: run[2] - run[1], default=(int(np.argmax(share)), 0, 0))
    joint, start, stop = longest
    return OverLimit(share=share, longest_s=(stop - start) / fps, start_s=start / fps, joint=joint, over=over, fps=fps)


def _runs(over: Bool[np.ndarray, "t j"]) -> list[tuple[int, int, int]]:
    """Joint, first and last frame (exclusive) of every run."""
    return [
        (int(joint), start, stop)
        for joint in np.flatnonzero(over.any(axis=0))
        for start, stop in time_series.runs(over[:, joint])
    ]
