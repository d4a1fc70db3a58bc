"""Criteria on the feet: slip, gliding, penetration, floating, flight and contact labels."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.feasibility.criterion import (
    NOTHING,
    Criterion,
    Metres,
    MetresPerSecondBySpeed,
    Result,
    Seconds,
    SecondsBySpeed,
    Skipped,
    ToleranceMetres,
    Verdict,
    criterion,
)
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.slowest_point import slowest_point_speed
from pipeline.files.ranges import SHARE
from pipeline.files.sourced import Unit
from pipeline.quality.retargeting import percentile_of_least
from pipeline.quality.sole import inner_contacts
from pipeline.robot.description import SIDES

NO_LABELS = "no contact labels"
LABELLED = "contacts are labelled"
SIMULATED = "the contacts are the simulation's"
NO_STANCE = "no foot is in contact"

SLIP, CONTACT = "foot slip", "contact consistency"


@dataclass(frozen=True, kw_only=True)
class FootSettings:
    """Limits for the feet."""

    level: ToleranceMetres
    """Height above the lowest corner up to which the corners of a sole count as on the ground [m]."""
    slip_mean: MetresPerSecondBySpeed
    """Largest mean slip of feet that are labelled as in contact [m/s]: a + b times the horizontal speed."""
    inferred_slip_mean: MetresPerSecondBySpeed
    """Largest mean slip for contact inferred from sole kinematics, the slower foot in double support [m/s]."""
    slip_p95: MetresPerSecondBySpeed
    """Largest 95th percentile of slip [m/s]: a + b times the horizontal speed."""
    glide_s: SecondsBySpeed
    """Longest time with a foot near the ground but none slow enough for a stance, without labels [s]: a + b times the
    horizontal speed at that time."""
    penetration_p95: Metres
    """Largest 95th percentile over frames of the depth of the lowest corner [m]."""
    penetration_max: Metres
    """Deepest corner [m]."""
    floating: Metres
    """Largest height of the lowest corner of a foot in contact [m]."""
    flight_height: Metres
    """Height above which both soles must be for a flight phase [m]."""
    flight_s: Seconds
    """Longest flight [s]."""
    disagreement: Annotated[float, SHARE, Unit("of foot-frames")]
    """Largest share of foot-frames in which label and sole disagree on contact."""


@criterion(
    Criterion(
        "foot_slip_mean",
        SLIP,
        "feet.slip_mean",
        "m/s",
        "mean slip of the sole's slowest point, feet labelled as in contact",
    ),
    Criterion(
        "foot_inferred_slip_mean",
        SLIP,
        "feet.inferred_slip_mean",
        "m/s",
        "mean slip for contact inferred from sole kinematics; the slower foot in double support",
    ),
    Criterion("foot_slip_p95", SLIP, "feet.slip_p95", "m/s", "95th percentile of slip, feet in contact"),
)
def foot_slip(motion: Motion, settings: FootSettings) -> tuple[Result, ...]:
    """Mean and 95th percentile of slip, with limits that grow with the horizontal speed.

    The mean is evaluated twice: for feet labelled as in contact, and for contact inferred from sole kinematics, so
    that wrong labels hide no slip. Inference treats a fast sliding foot as not in contact, so its slip is lower in good
    and bad motion, and its limit is lower, too.
    """
    slip = slowest_point_speed(motion.sole, settings.level)
    standing, inferred = stance_feet(motion, slip)
    speed = motion.ground_speed
    if motion.labelled:
        labelled = _mean_slip("foot_slip_mean", "feet in contact", slip, standing, settings.slip_mean, speed)
    else:
        labelled = Skipped(code="foot_slip_mean", not_applicable=NO_LABELS)
    if motion.simulated:
        of_soles = Skipped(code="foot_inferred_slip_mean", not_applicable=SIMULATED)
    else:
        of_soles = _mean_slip(
            "foot_inferred_slip_mean", "the slower feet", slip, inferred, settings.inferred_slip_mean, speed
        )
    found = slip[standing]
    value = percentile_of_least(found, 95, motion.least_frames) if found.size else 0.0
    limit = settings.slip_p95[0] + settings.slip_p95[1] * speed
    p95 = Verdict(
        code="foot_slip_p95",
        value=value,
        limit=limit,
        text=f"feet in contact slide, at {speed:.2f} m/s over ground, at more than {value:.2f} m/s in 5 % of the time",
        bad=_sliding_stances(slip, standing, limit) if value > limit else None,
        not_applicable="" if standing.any() else NO_STANCE,
    )
    return labelled, of_soles, p95


def stance_feet(
    motion: Motion, slip: Float[np.ndarray, "t 2"]
) -> tuple[Bool[np.ndarray, "t 2"], Bool[np.ndarray, "t 2"]]:
    """Masks of the feet whose slip is measured: by contact labels (inferred if there are none), and by inferred
    contact.

    The first and last frame of a contact are left out, since finite differences there include the swing. In inferred
    double support only the slower foot counts: a foot that lands or lifts off within 0.01 m of the ground looks like a
    sliding one.

    Args:
        slip: slip of each foot [m/s]
    """
    contacts = motion.inferred_contacts
    slower = np.argmin(slip, axis=1)[:, None] == np.arange(2)
    of_soles = inner_contacts(contacts) & (slower | ~contacts.all(axis=1, keepdims=True))
    return (inner_contacts(motion.contacts) if motion.labelled else of_soles), of_soles


@criterion(
    Criterion(
        "foot_glide_s",
        SLIP,
        "feet.glide_s",
        "s",
        "longest time with a sole near the ground and no foot slow enough for a stance",
    )
)
def gliding(motion: Motion, settings: FootSettings) -> tuple[Result, ...]:
    """Longest time with a sole near the ground and no foot in contact, relative to the limit for its horizontal speed.
    Skipped if contacts are labelled.

    Without labels, a fast sliding foot is inferred as not in contact, so its slip is not measured, and it is too low
    for a flight phase. In a good run a foot is that low and fast only just after take-off and before landing.
    """
    if motion.labelled:
        return (Skipped(code="foot_glide_s", not_applicable=SIMULATED if motion.simulated else LABELLED),)
    fps, (standing, by_speed) = motion.clip.fps, settings.glide_s
    limit = standing + by_speed * np.hypot(motion.commands[:, 0], motion.commands[:, 1])
    near = np.any(motion.sole.height < motion.contact.height, axis=1)
    spans = time_series.runs(near & ~motion.contacts.any(axis=1))
    times = [((stop - start) / fps, float(limit[start:stop].mean()), start) for start, stop in spans]
    value, allowed, first = max(times, key=lambda each: each[0] - each[1], default=(0.0, float(limit.mean()), 0))
    bad = np.zeros(len(near), dtype=bool)
    for (start, stop), (seconds, most, _) in zip(spans, times, strict=True):
        bad[start:stop] = seconds > most
    near_cm = 100.0 * motion.contact.height
    return (
        Verdict(
            code="foot_glide_s",
            value=value,
            limit=allowed,
            text=f"from {first / fps:.2f} s on feet glide for {value:.2f} s: within {near_cm:g} cm of the ground, and "
            "none slow enough to stand",
            bad=bad,
            not_applicable=SIMULATED if motion.simulated else "",
        ),
    )


@criterion(
    Criterion(
        "penetration_p95",
        "penetration",
        "feet.penetration_p95",
        "m",
        "depth of the lowest corner of a sole, 95th percentile",
    ),
    Criterion("penetration_max", "penetration", "feet.penetration_max", "m", "largest depth of a sole corner"),
)
def penetration(motion: Motion, settings: FootSettings) -> tuple[Verdict, Verdict]:
    """Depth of the lowest sole corner below the ground: 95th percentile over frames, and maximum."""
    depth = np.maximum(-motion.sole.height.min(axis=1), 0.0)
    p95, frame = percentile_of_least(depth, 95, motion.least_frames), int(np.argmax(depth))
    return (
        Verdict(
            code="penetration_p95",
            value=p95,
            limit=settings.penetration_p95,
            text=f"a sole is more than {100 * p95:.1f} cm below the ground in 5 % of the time",
            bad=depth > settings.penetration_p95,
        ),
        Verdict(
            code="penetration_max",
            value=float(depth[frame]),
            limit=settings.penetration_max,
            text=f"frame {frame}: a sole is {100 * depth[frame]:.1f} cm below the ground",
            bad=depth > settings.penetration_max,
        ),
    )


@criterion(Criterion("floating_contact", CONTACT, "feet.floating", "m", "height of the soles of feet in contact"))
def floating(motion: Motion, settings: FootSettings) -> tuple[Verdict, ...]:
    """Height of the lowest corner of feet that are labelled as in contact."""
    height = np.where(inner_contacts(motion.contacts), motion.sole.height, 0.0)
    frame, side = np.unravel_index(np.argmax(height), height.shape)
    value = max(float(height[frame, side]), 0.0)
    verdict = Verdict(
        code="floating_contact",
        value=value,
        limit=settings.floating,
        text=f"frame {frame}: the {SIDES[side]} foot is labelled as in contact, {100 * value:.1f} cm above the ground",
        bad=np.any(height > settings.floating, axis=1),
    )
    return (verdict,)


@criterion(
    Criterion(
        "flight_s",
        CONTACT,
        "feet.flight_s",
        "s",
        "longest time with both soles off the ground, or with no foot in contact",
    )
)
def flight(motion: Motion, settings: FootSettings) -> tuple[Verdict, ...]:
    """Longest time without support: both soles above the ground, or neither foot in contact.

    Feet that slide too fast to be in contact do not support the robot either.
    """
    above = np.all(motion.sole.height > settings.flight_height, axis=1) | ~motion.contacts.any(axis=1)
    fps = motion.clip.fps
    flights = time_series.runs(above)
    longest = max(flights, key=lambda span: span[1] - span[0], default=(0, 0))
    value = (longest[1] - longest[0]) / fps
    bad = np.zeros(len(above), dtype=bool)
    for start, stop in flights:
        bad[start:stop] = (stop - start) / fps > settings.flight_s
    verdict = Verdict(
        code="flight_s",
        value=value,
        limit=settings.flight_s,
        text=f"from {longest[0] / fps:.2f} s on no foot is on the ground for {value:.2f} s",
        bad=bad,
    )
    return (verdict,)


@criterion(
    Criterion(
        "contact_disagreement",
        CONTACT,
        "feet.disagreement",
        "of foot-frames",
        "share of foot-frames in which label and sole disagree",
        cuts=NOTHING,
    )
)
def label_disagreement(motion: Motion, settings: FootSettings) -> tuple[Result, ...]:
    """Share of foot-frames where label and sole disagree on contact; 0 for a clip without labels.

    Skipped where the contacts are those of a simulation.
    """
    if motion.simulated:
        return (Skipped(code="contact_disagreement", not_applicable=SIMULATED),)
    value = float(np.mean(motion.inferred_contacts != motion.contacts))
    return (
        Verdict(
            code="contact_disagreement",
            value=value,
            limit=motion.largest_share(settings.disagreement),
            text=f"contact labels and the soles' motion disagree in {100 * value:.0f} % of the foot-frames",
            not_applicable="" if motion.labelled else NO_LABELS,
        ),
    )


def _mean_slip(
    code: str,
    feet: str,
    slip: Float[np.ndarray, "t 2"],
    standing: Bool[np.ndarray, "t 2"],
    limits: tuple[float, float],
    speed: float,
) -> Verdict:
    """Verdict on the mean slip [m/s] of the feet in contact, at a horizontal speed [m/s]."""
    found = slip[standing]
    value, limit = float(found.mean()) if found.size else 0.0, limits[0] + limits[1] * speed
    return Verdict(
        code=code,
        value=value,
        limit=limit,
        text=f"{feet} slide, at {speed:.2f} m/s over ground, at {value:.2f} m/s on average",
        bad=_sliding_stances(slip, standing, limit) if value > limit else None,
        not_applicable="" if standing.any() else NO_STANCE,
    )


def _sliding_stances(
    slip: Float[np.ndarray, "t 2"], standing: Bool[np.ndarray, "t 2"], limit: float
) -> Bool[np.ndarray, " t"]:
    """Mask of the frames in stances whose mean slip is above the limit."""
    bad = np.zeros(len(slip), dtype=bool)
    for side in range(2):
        for start, stop in time_series.runs(standing[:, side]):
            if slip[start:stop, side].mean() > limit:
                bad[start:stop] = True
    return bad
