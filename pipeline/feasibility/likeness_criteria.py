"""How well KP3 kept to the human: the figures it gave a clip, held against limits. A robot's recording has none."""

from __future__ import annotations

from pipeline.clips.outcome import Numbers
from pipeline.feasibility.likeness_settings import LikenessSettings
from pipeline.feasibility.verdict import Verdict

FIGURES: dict[str, tuple[str, str]] = {
    "slip_m_s": ("m/s", "the retargeted feet slide in stance by {:.3f} m/s on average"),
    "drift_m": ("m", "the retargeted feet drift within a stance by {:.3f} m"),
    "penetration_m": ("m", "the retargeted soles are {:.3f} m below the ground"),
    "height_shift_m": ("m", "the retargeted motion stands {:.3f} m off the ground"),
    "limb_error_deg": ("deg", "limbs point {:.1f} deg away from the human's"),
    "thigh_error_deg": ("deg", "thighs point {:.1f} deg away from the human's"),
    "shank_error_deg": ("deg", "shanks point {:.1f} deg away from the human's"),
    "trunk_error_deg": ("deg", "the trunk is {:.1f} deg away from the human's"),
    "heading_error_deg": ("deg", "the pelvis heads {:.1f} deg away from the human's"),
}
"""Unit and sentence of each of KP3's numbers that is held against a limit."""


def likeness(numbers: Numbers, settings: LikenessSettings) -> tuple[Verdict, ...]:
    """Verdicts on KP3's numbers of a clip; a number that is not there, or has no sample, has no verdict."""
    verdicts = []
    for name, (unit, text) in FIGURES.items():
        value = numbers.get(name)
        if isinstance(value, int | float):
            size = abs(float(value))
            limit = getattr(settings, name)
            verdicts.append(Verdict(code=name, value=size, limit=limit, unit=unit, text=text.format(size)))
    return tuple(verdicts)
