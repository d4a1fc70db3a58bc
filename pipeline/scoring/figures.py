"""The figures a motion is judged by, each with its definition, and how they are pooled over clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One number a motion has."""

    key: str
    """Its name in JSON, with its unit."""
    title: str
    unit: str
    largest: bool = False
    """Pooled as the largest sample; else the mean, so that clips weigh by their samples (frames, stances)."""


FIGURES = (
    Figure(key="position_limit_percent", title="frames over a joint limit", unit="%"),
    Figure(key="speed_limit_percent", title="frames over a speed limit", unit="%"),
    Figure(key="slip_strict_m_s", title="foot slip, strict labels", unit="m/s"),
    Figure(key="slip_middle_m_s", title="foot slip, middle labels", unit="m/s"),
    Figure(key="slip_loose_m_s", title="foot slip, loose labels", unit="m/s"),
    Figure(key="drift_cm", title="drift within a stance", unit="cm"),
    Figure(key="penetration_max_cm", title="deepest penetration", unit="cm", largest=True),
    Figure(key="penetration_over_1cm_percent", title="frames over 1 cm deep", unit="%"),
    Figure(key="jerk_rad_s3", title="jerk", unit="rad/s³"),
    Figure(key="jump_percent", title="jump frames", unit="%"),
    Figure(key="self_collision_percent", title="self-collision frames", unit="%"),
    Figure(key="self_collision_max_cm", title="deepest self-collision", unit="cm", largest=True),
    Figure(key="limb_error_deg", title="limb direction error", unit="deg"),
    Figure(key="thigh_error_deg", title="thigh direction error", unit="deg"),
    Figure(key="shank_error_deg", title="shank direction error", unit="deg"),
    Figure(key="trunk_error_deg", title="trunk orientation error", unit="deg"),
    Figure(key="heading_error_deg", title="pelvis heading error", unit="deg"),
    Figure(key="pelvis_tilt_error_deg", title="pelvis roll and pitch error", unit="deg"),
    Figure(key="height_shift_mm", title="height shift", unit="mm", largest=True),
)
"""In the order of the report. docs/retarget.md defines them."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """The samples of each figure: one a frame, a standing frame, a stance or a clip."""

    frames: int
    samples: Mapping[str, Float[np.ndarray, " n"]] = field(repr=False)
    """By the figure's key, in its unit."""

    def figures(self) -> dict[str, float]:
        """Each figure by its key; NaN where the motion has no sample of it (slip where no foot ever stands)."""
        return {figure.key: _pool(self.samples[figure.key], figure.largest) for figure in FIGURES}


def pooled(scores: Sequence[Score]) -> Score:
    """All clips as one: samples side by side."""
    return Score(
        frames=sum(score.frames for score in scores),
        samples={figure.key: np.concatenate([score.samples[figure.key] for score in scores]) for figure in FIGURES},
    )


def _pool(samples: Float[np.ndarray, " n"], largest: bool) -> float:
    if not len(samples):
        return float("nan")
    return float(samples.max() if largest else samples.mean())
