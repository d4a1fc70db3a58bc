"""The figures of a score, each with its definition, and their pooling over clips."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from jaxtyping import Float


class Pooling(Enum):
    """How samples of several clips are pooled to one figure; clips are weighted by their number of samples."""

    MEAN = "mean"
    LARGEST = "largest"
    RMS = "root mean square"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One figure of a score."""

    key: str
    """Name in JSON, with the unit."""
    title: str
    unit: str
    pooling: Pooling = Pooling.MEAN
    bar: float | None = None
    """Largest allowed value over many clips; None if it is only reported."""
    at_30_hz: bool = False
    """Whether it depends on the rate; then its bar is for 30 Hz."""


FIGURES = (
    Figure(key="position_limit_percent", title="frames over a joint limit", unit="%", bar=0.0),
    Figure(key="speed_limit_percent", title="frames over a speed limit", unit="%", bar=0.0),
    Figure(key="slip_strict_m_s", title="foot slip, strict labels", unit="m/s", bar=0.012),
    Figure(key="slip_middle_m_s", title="foot slip, middle labels", unit="m/s", bar=0.01),
    Figure(key="slip_loose_m_s", title="foot slip, loose labels", unit="m/s"),
    Figure(key="drift_cm", title="drift within a stance", unit="cm", bar=0.5),
    Figure(key="penetration_max_cm", title="deepest penetration", unit="cm", pooling=Pooling.LARGEST, bar=1.5),
    Figure(key="penetration_over_1cm_percent", title="frames over 1 cm deep", unit="%", bar=0.3),
    Figure(key="jerk_rad_s3", title="jerk", unit="rad/s³", bar=220.0, at_30_hz=True),
    Figure(key="jump_percent", title="jump frames", unit="%", bar=0.4, at_30_hz=True),
    Figure(key="self_collision_percent", title="self-collision frames", unit="%", bar=1),
    Figure(key="self_collision_max_cm", title="deepest self-collision", unit="cm", pooling=Pooling.LARGEST, bar=2),
    Figure(
        key="pelvis_velocity_error_m_s",
        title="pelvis velocity error, RMS",
        unit="m/s",
        pooling=Pooling.RMS,
        bar=0.15,
    ),
    Figure(
        key="pelvis_acceleration_ratio",
        title="peak pelvis acceleration / scaled human's",
        unit="",
        pooling=Pooling.LARGEST,
        bar=2,
    ),
    Figure(key="limb_error_deg", title="limb direction error", unit="deg", bar=2.5),
    Figure(key="thigh_error_deg", title="thigh direction error", unit="deg", bar=4),
    Figure(key="shank_error_deg", title="shank direction error", unit="deg", bar=4),
    Figure(key="trunk_error_deg", title="trunk orientation error", unit="deg", bar=3.5),
    Figure(key="heading_error_deg", title="pelvis heading error", unit="deg", bar=2),
    Figure(key="pelvis_tilt_error_deg", title="pelvis roll and pitch error", unit="deg"),
    Figure(key="height_shift_mm", title="height shift", unit="mm", pooling=Pooling.LARGEST, bar=5),
)
"""Figures in the order of the report, with this project's bars. docs/retarget.md defines them."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """Samples of each figure: one per frame, standing frame, stance or clip."""

    frames: int
    samples: Mapping[str, Float[np.ndarray, " n"]] = field(repr=False)
    """Samples by the figure's key, in its unit."""

    def figures(self) -> dict[str, float]:
        """Each figure by its key; NaN without samples (slip if no foot ever stands)."""
        return {figure.key: _pool(self.samples[figure.key], figure.pooling) for figure in FIGURES}


def worst_of_bars(figures: Mapping[str, float], fps: float) -> tuple[str, float]:
    """Key of the figure with the largest ratio to its bar, and that ratio.

    Figures without a bar at this rate, with a bar of 0 or without a value are left out; ("", 0) if none remains.
    """
    shares = {
        figure.key: figures[figure.key] / figure.bar
        for figure in FIGURES
        if figure.bar and np.isfinite(figures[figure.key]) and (fps == 30.0 or not figure.at_30_hz)
    }
    return max(shares.items(), key=lambda item: item[1]) if shares else ("", 0.0)


def pooled(scores: Sequence[Score]) -> Score:
    """The samples of all clips concatenated."""
    return Score(
        frames=sum(score.frames for score in scores),
        samples={figure.key: np.concatenate([score.samples[figure.key] for score in scores]) for figure in FIGURES},
    )


def _pool(samples: Float[np.ndarray, " n"], pooling: Pooling) -> float:
    if not len(samples):
        return float("nan")
    if pooling is Pooling.RMS:
        return float(np.sqrt(np.mean(samples**2)))
    return float(samples.max() if pooling is Pooling.LARGEST else samples.mean())
