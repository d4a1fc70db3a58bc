"""Limits of KP3's figures of a clip: the section `likeness` of `data/feasibility.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.feasibility.units import Degrees, Metres, MetresPerSecond
from pipeline.files.ranges import Range, check

_SPEED = Range(0.0, 5.0)
_LENGTH = Range(0.0, 1.0)
_ANGLE_DEG = Range(0.0, 180.0)


@dataclass(frozen=True, kw_only=True)
class LikenessSettings:
    """Largest of KP3's figures of a clip, by the names they have there."""

    slip_m_s: MetresPerSecond
    """Mean speed of the sole in stance, by the scorer's middle labels [m/s]."""
    drift_m: Metres
    """Drift within a stance [m]."""
    penetration_m: Metres
    """Deepest sole corner [m]."""
    height_shift_m: Metres
    """How far the clip as a whole stands off the ground [m]."""
    limb_error_deg: Degrees
    """Mean angle of all limbs to the human's [deg]."""
    thigh_error_deg: Degrees
    """Mean angle of the thighs [deg]."""
    shank_error_deg: Degrees
    """Mean angle of the shanks [deg]."""
    trunk_error_deg: Degrees
    """Mean angle of the trunk [deg]."""
    heading_error_deg: Degrees
    """Mean angle of the pelvis heading [deg]."""

    def __post_init__(self) -> None:
        check(
            self,
            slip_m_s=_SPEED,
            drift_m=_LENGTH,
            penetration_m=_LENGTH,
            height_shift_m=_LENGTH,
            limb_error_deg=_ANGLE_DEG,
            thigh_error_deg=_ANGLE_DEG,
            shank_error_deg=_ANGLE_DEG,
            trunk_error_deg=_ANGLE_DEG,
            heading_error_deg=_ANGLE_DEG,
        )
