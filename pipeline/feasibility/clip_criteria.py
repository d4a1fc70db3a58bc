"""Criteria on self-collision, on likeness to the person (by the numbers of KP3) and on length."""

from dataclasses import dataclass

import numpy as np

from pipeline.clips.outcome import Numbers
from pipeline.feasibility import criterion as registry
from pipeline.feasibility.criterion import (
    NOTHING,
    NUMBERS,
    WHOLE_CLIP,
    Criterion,
    Degrees,
    Result,
    ShareOfFrames,
    Skipped,
    ToleranceMetres,
    ToleranceMetresPerSecond,
    Verdict,
    criterion,
)
from pipeline.feasibility.motion import CutSettings, Motion
from pipeline.simulation.mujoco_plant import self_collision

GROUP = "self-collision"


@dataclass(frozen=True, kw_only=True)
class CollisionSettings:
    """Limits for self-collision."""

    depth: ToleranceMetres
    """Deepest overlap of two shapes [m]."""
    contact_depth: ToleranceMetres
    """Overlap above which a frame counts for the share [m]."""
    share: ShareOfFrames
    """Largest share of frames with such an overlap."""


@criterion(
    Criterion("self_collision_depth", GROUP, "collision.depth", "m", "deepest overlap of two collision shapes"),
    Criterion("self_collision_share", GROUP, "collision.share", "of frames", "share of frames with an overlap"),
)
def collisions(motion: Motion, settings: CollisionSettings) -> tuple[Verdict, Verdict]:
    """Deepest overlap of two of the robot's shapes, and the share of frames with a significant overlap."""
    found = self_collision(motion.clip, motion.robot)
    frame = int(np.argmax(found.depth))
    pair = " and ".join(found.pairs[frame] or ("no shapes",))
    overlap = found.depth > settings.contact_depth
    share = float(np.mean(overlap))
    return (
        Verdict(
            code="self_collision_depth",
            value=float(found.depth[frame]),
            limit=settings.depth,
            text=f"frame {frame}: {pair} overlap by {100 * found.depth[frame]:.1f} cm",
            bad=found.depth > settings.depth,
        ),
        Verdict(
            code="self_collision_share",
            value=share,
            limit=motion.largest_share(settings.share),
            text=f"parts overlap in {100 * share:.0f} % of the frames, most {pair}",
            bad=overlap,
        ),
    )


NO_FIGURES = "no figure of retargeting"

TOO_SHORT = "too_short"


@dataclass(frozen=True, kw_only=True)
class LikenessSettings:
    """Upper bounds of KP3's numbers of a clip, with the same names."""

    slip_m_s: ToleranceMetresPerSecond
    """Mean speed of the sole in stance, by the scorer's middle labels [m/s]."""
    drift_m: ToleranceMetres
    """Drift within a stance [m]."""
    penetration_m: ToleranceMetres
    """Deepest sole corner [m]."""
    height_shift_m: ToleranceMetres
    """Offset of the clip as a whole from the ground [m]."""
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


def _figure(name: str, unit: str, what: str) -> Criterion:
    return Criterion(name, "likeness to the person", f"likeness.{name}", unit, what, cuts=WHOLE_CLIP, of=NUMBERS)


FIGURES: dict[Criterion, str] = {
    _figure("slip_m_s", "m/s", "slip in stance"): "the retargeted feet slide in stance by {:.3f} m/s on average",
    _figure("drift_m", "m", "drift within a stance"): "the retargeted feet drift within a stance by {:.3f} m",
    _figure(
        "penetration_m", "m", "largest depth of a sole corner below the ground"
    ): "the retargeted soles are {:.3f} m below the ground",
    _figure(
        "height_shift_m", "m", "height of standing soles above the ground"
    ): "the retargeted motion stands {:.3f} m off the ground",
    _figure(
        "limb_error_deg", "deg", "mean angle between human and robot limbs"
    ): "limbs point {:.1f} deg away from the human's",
    _figure("thigh_error_deg", "deg", "mean angle between the thighs"): "thighs point {:.1f} deg away from the human's",
    _figure("shank_error_deg", "deg", "mean angle between the shanks"): "shanks point {:.1f} deg away from the human's",
    _figure("trunk_error_deg", "deg", "mean angle between the trunks"): "the trunk is {:.1f} deg away from the human's",
    _figure(
        "heading_error_deg", "deg", "mean error of the pelvis heading"
    ): "the pelvis heads {:.1f} deg away from the human's",
}
"""Number of KP3 -> format string of the sentence with its value."""


@criterion(*FIGURES)
def likeness(numbers: Numbers, settings: LikenessSettings) -> tuple[Result, ...]:
    """Verdicts on KP3's numbers of a clip; skipped where a number is missing or has no samples."""
    return tuple(_likeness(each.code, text, numbers, settings) for each, text in FIGURES.items())


def _likeness(name: str, text: str, numbers: Numbers, settings: LikenessSettings) -> Result:
    value = numbers.get(name)
    if isinstance(value, int | float):
        size = abs(float(value))
        return Verdict(code=name, value=size, limit=getattr(settings, name), text=text.format(size))
    why = "KP3 had no sample of it" if name in numbers else "the robot's own recording"
    return Skipped(code=name, not_applicable=f"{NO_FIGURES}: {why}")


@criterion(
    Criterion(TOO_SHORT, "length", "cut.min_seconds", "s", "length", cuts=NOTHING, lower=True, of=registry.LENGTH)
)
def length(seconds: float, settings: CutSettings) -> tuple[Verdict]:
    """The verdict on the length of a stretch [s]."""
    return (Verdict(code=TOO_SHORT, value=seconds, limit=settings.min_seconds, text=f"only {seconds:.2f} s long"),)
