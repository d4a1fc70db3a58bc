"""Criteria of the feet: slip, gliding, penetration, floating, flight, labels."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from pipeline import time_series
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.settings import FootSettings
from pipeline.feasibility.slowest_point import slowest_point_speed
from pipeline.feasibility.verdict import Verdict
from pipeline.quality.foot_slip import inner_contacts
from pipeline.quality.percentile import percentile_of_least
from pipeline.quality.sole_contact import contact_from_sole

SIDES = ("left", "right")


def foot_slip(motion: Motion, settings: FootSettings) -> tuple[Verdict, Verdict]:
    """Mean and 95th percentile of slip against limits that grow with the speed over ground.

    The mean has a limit of its own where nothing is labelled: a foot that slides fast is then told as not in contact,
    so that what is left of slip is less, of good motion and of bad.
    """
    slip = slowest_point_speed(motion.sole, settings.level)
    standing = _standing(motion, slip)
    found = slip[standing]
    mean_slip = float(found.mean()) if found.size else 0.0
    p95_slip = percentile_of_least(found, 95, motion.least_frames) if found.size else 0.0
    speed = motion.ground_speed
    still, by_speed = settings.slip_mean if motion.labelled else settings.told_slip_mean
    mean_limit = still + by_speed * speed
    p95_limit = settings.slip_p95[0] + settings.slip_p95[1] * speed
    text = f"feet in contact slide, at {speed:.2f} m/s over ground, at"
    mean = Verdict(
        code="foot_slip_mean",
        value=mean_slip,
        limit=mean_limit,
        unit="m/s",
        text=f"{text} {mean_slip:.2f} m/s on average",
        bad=_sliding_stances(slip, standing, mean_limit),
    )
    p95 = Verdict(
        code="foot_slip_p95",
        value=p95_slip,
        limit=p95_limit,
        unit="m/s",
        text=f"{text} more than {p95_slip:.2f} m/s in 5 % of the time",
        bad=_sliding_stances(slip, standing, p95_limit),
    )
    return mean, p95


def gliding(motion: Motion, settings: FootSettings) -> tuple[Verdict, ...]:
    """Time in a row that a sole is near the ground and no foot stands: of all such times the one furthest past what its
    speed over ground allows. No verdict where contacts are labelled.

    Without labels a foot that slides fast is told as not in contact, so that no slip is asked of it, and it is too low
    for a flight. In a good run it is so low and so fast only just after it left the ground and before it comes down.
    """
    if motion.labelled:
        return ()
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
            unit="s",
            text=f"from {first / fps:.2f} s on feet glide for {value:.2f} s: within {near_cm:g} cm of the ground, and "
            "none slow enough to stand",
            bad=bad,
        ),
    )


def penetration(motion: Motion, settings: FootSettings) -> tuple[Verdict, Verdict]:
    """Depth of the lowest corner of each frame below the ground: 95th percentile and most."""
    depth = np.maximum(-motion.sole.height.min(axis=1), 0.0)
    p95, frame = percentile_of_least(depth, 95, motion.least_frames), int(np.argmax(depth))
    return (
        Verdict(
            code="penetration_p95",
            value=p95,
            limit=settings.penetration_p95,
            unit="m",
            text=f"a sole is more than {100 * p95:.1f} cm below the ground in 5 % of the time",
            bad=depth > settings.penetration_p95,
        ),
        Verdict(
            code="penetration_max",
            value=float(depth[frame]),
            limit=settings.penetration_max,
            unit="m",
            text=f"frame {frame}: a sole is {100 * depth[frame]:.1f} cm below the ground",
            bad=depth > settings.penetration_max,
        ),
    )


def floating(motion: Motion, settings: FootSettings) -> Verdict:
    """Height of the lowest corner of feet that are labelled as in contact."""
    height = np.where(inner_contacts(motion.contacts), motion.sole.height, 0.0)
    frame, side = np.unravel_index(np.argmax(height), height.shape)
    value = max(float(height[frame, side]), 0.0)
    return Verdict(
        code="floating_contact",
        value=value,
        limit=settings.floating,
        unit="m",
        text=f"frame {frame}: the {SIDES[side]} foot is said to stand and is {100 * value:.1f} cm above the ground",
        bad=np.any(height > settings.floating, axis=1),
    )


def flight(motion: Motion, settings: FootSettings) -> Verdict:
    """Longest time with no foot on the ground: both soles above it, or neither foot in contact.

    Feet that skate too fast to be in contact carry nothing either.
    """
    above = np.all(motion.sole.height > settings.flight_height, axis=1) | ~motion.contacts.any(axis=1)
    fps = motion.clip.fps
    flights = time_series.runs(above)
    longest = max(flights, key=lambda span: span[1] - span[0], default=(0, 0))
    value = (longest[1] - longest[0]) / fps
    bad = np.zeros(len(above), dtype=bool)
    for start, stop in flights:
        bad[start:stop] = (stop - start) / fps > settings.flight_s
    return Verdict(
        code="flight_s",
        value=value,
        limit=settings.flight_s,
        unit="s",
        text=f"from {longest[0] / fps:.2f} s on no foot is on the ground for {value:.2f} s",
        bad=bad,
    )


def label_disagreement(motion: Motion, settings: FootSettings) -> Verdict:
    """Share of foot-frames where label and sole disagree on contact; 0 for a clip without labels."""
    seen = contact_from_sole(motion.sole, motion.contact)
    value = float(np.mean(seen != motion.contacts)) if motion.labelled else 0.0
    return Verdict(
        code="contact_disagreement",
        value=value,
        limit=motion.largest_share(settings.disagreement),
        unit="of foot-frames",
        text=f"contact labels and the soles' motion disagree in {100 * value:.0f} % of the foot-frames",
    )


def _standing(motion: Motion, slip: Float[np.ndarray, "t 2"]) -> Bool[np.ndarray, "t 2"]:
    """Feet that have to stand still: those labelled as in contact.

    Where nothing is labelled, a foot that comes down or leaves within a centimetre of the ground looks like one that
    slides. Of two feet that seem to be down only the slower one is held to stand: the other may be on its way.
    """
    standing = inner_contacts(motion.contacts)
    if not motion.labelled:
        slower = np.argmin(slip, axis=1)[:, None] == np.arange(2)
        standing &= slower | ~standing.all(axis=1, keepdims=True)
    return standing


def _sliding_stances(
    slip: Float[np.ndarray, "t 2"], standing: Bool[np.ndarray, "t 2"], limit: float
) -> Bool[np.ndarray, " t"]:
    """Frames of stances whose own mean slip is above the limit."""
    bad = np.zeros(len(slip), dtype=bool)
    for side in range(2):
        for start, stop in time_series.runs(standing[:, side]):
            if slip[start:stop, side].mean() > limit:
                bad[start:stop] = True
    return bad
