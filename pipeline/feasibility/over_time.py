"""Duration and frequency of limit violations: share of frames, longest uninterrupted time, means over windows.

Each joint is evaluated separately: if twenty joints each exceed a limit for a moment in each stride, some joint does in
most frames.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.feasibility.criterion import Verdict
from pipeline.feasibility.motion import Motion


@dataclass(frozen=True, kw_only=True)
class OverLimit:
    """Limit violations of a motion's joints."""

    share: Float[np.ndarray, " j"]
    """Share of each joint's frames over the limit."""
    longest_s: float
    """Longest uninterrupted time of any joint over the limit [s]."""
    start_s: float
    """Start of that time [s]."""
    joint: int
    """Index of that joint."""
    over: Bool[np.ndarray, "t j"]
    fps: float

    @property
    def worst(self) -> int:
        """The joint with the largest share."""
        return int(np.argmax(self.share))

    def frames_of_joints_over(self, share: float) -> Bool[np.ndarray, " t"]:
        """Frames in which a joint with a share above `share` is over its limit."""
        return np.any(self.over[:, self.share > share], axis=1)

    def frames_of_runs_over(self, run_s: float) -> Bool[np.ndarray, " t"]:
        """Frames in runs that are longer than `run_s`."""
        bad = np.zeros(len(self.over), dtype=bool)
        for _, start, stop in _runs(self.over):
            bad[start:stop] |= (stop - start) / self.fps > run_s
        return bad


def over_limit(over: Bool[np.ndarray, "t j"], motion: Motion) -> OverLimit:
    """Summary of the frames in which joints are over a limit."""
    fps, share = motion.clip.fps, np.mean(over, axis=0)
    longest = max(_runs(over), key=lambda run: run[2] - run[1], default=(int(np.argmax(share)), 0, 0))
    joint, start, stop = longest
    return OverLimit(share=share, longest_s=(stop - start) / fps, start_s=start / fps, joint=joint, over=over, fps=fps)


def share_and_run(
    codes: tuple[str, str],
    over: Bool[np.ndarray, "t j"],
    limits: tuple[float, float],
    motion: Motion,
    texts: tuple[str, str],
) -> tuple[Verdict, Verdict]:
    """Two verdicts on joints over a limit: largest share of a joint's frames, and longest uninterrupted time.

    Args:
        codes: criteria of the share and of the run
        over: frames in which each joint is over its limit
        limits: largest share of a joint's frames, and longest time [s]
        motion: the motion
        texts: sentences with `{joint}`, `{percent}` of its frames, `{start_s}` and `{run_s}`
    """
    found, names = over_limit(over, motion), motion.robot.joint_names
    most, largest = found.worst, motion.largest_share(limits[0])
    facts = {"percent": 100 * found.share[most], "start_s": found.start_s, "run_s": found.longest_s}
    share = Verdict(
        code=codes[0],
        value=float(found.share[most]),
        limit=largest,
        text=texts[0].format(joint=names[most], **facts),
        bad=found.frames_of_joints_over(largest),
    )
    run = Verdict(
        code=codes[1],
        value=found.longest_s,
        limit=limits[1],
        text=texts[1].format(joint=names[found.joint], **facts),
        bad=found.frames_of_runs_over(limits[1]),
    )
    return share, run


def windowed_mean(values: Float[np.ndarray, "t ..."], width: int) -> Float[np.ndarray, "t ..."]:
    """Mean over `width` frames (odd) centred at each frame. At the ends, windows are shifted, not shortened, as finite
    differences are noisiest there; a clip shorter than a window is one window."""
    if len(values) <= width:
        return np.broadcast_to(values.mean(axis=0), values.shape).copy()
    half = width // 2
    centre = np.clip(np.arange(len(values)), half, len(values) - 1 - half)
    return time_series.moving_mean(values, width)[centre]


def odd_width(seconds: float, fps: float) -> int:
    """Largest odd number of frames of a window that extends at most `seconds` / 2 to either side."""
    return 2 * int(seconds * fps / 2.0 + 1e-9) + 1


def _runs(over: Bool[np.ndarray, "t j"]) -> list[tuple[int, int, int]]:
    """Joint, first and last frame (exclusive) of every run."""
    return [
        (int(joint), start, stop)
        for joint in np.flatnonzero(over.any(axis=0))
        for start, stop in time_series.runs(over[:, joint])
    ]
