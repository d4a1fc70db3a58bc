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

SIDES = ("left", "right")


def foot_slip(motion: Motion, settings: FootSettings) -> tuple[Verdict, ...]:
    """Mean and 95th percentile of slip against limits that grow with the speed over ground.

    The mean is asked twice: of feet that are labelled as in contact, where something is labelled, and in any motion of
    those that the soles tell to be. A label moves no foot: who slides is not to hold because feet are labelled, or
    wrongly. A foot that slides fast is told as not in contact, so that what is left of slip is less, of good motion
    and of bad, and the limit lower.
    """
    slip = slowest_point_speed(motion.sole, settings.level)
    standing, told = held_to_stand(motion, settings)
    mean = _mean_slip("foot_slip_mean", "feet in contact", slip, standing, settings.slip_mean, motion)
    of_soles = _mean_slip("foot_told_slip_mean", "the slower feet", slip, told, settings.told_slip_mean, motion)
    found, speed = slip[standing], motion.ground_speed
    value = percentile_of_least(found, 95, motion.least_frames) if found.size else 0.0
    limit = settings.slip_p95[0] + settings.slip_p95[1] * speed
    p95 = Verdict(
        code="foot_slip_p95",
        value=value,
        limit=limit,
        unit="m/s",
        text=f"feet in contact slide, at {speed:.2f} m/s over ground, at more than {value:.2f} m/s in 5 % of the time",
        bad=_sliding_stances(slip, standing, limit),
    )
    return (*((mean,) if motion.labelled else ()), *(() if motion.simulated else (of_soles,)), p95)


def held_to_stand(motion: Motion, settings: FootSettings) -> tuple[Bool[np.ndarray, "t 2"], Bool[np.ndarray, "t 2"]]:
    """Feet of which slip is asked: those in contact by their labels, or as the soles tell it where nothing is labelled,
    and those that the soles tell, whatever is labelled. Where there are none, slip says nothing.

    A difference at either end of a contact sees the swing. Of two feet that the soles tell to be in contact it is the
    slower one: a foot that comes down or leaves within a centimetre of the ground looks like one that slides, and may
    be on its way.
    """
    slip, told = slowest_point_speed(motion.sole, settings.level), motion.told_contacts
    slower = np.argmin(slip, axis=1)[:, None] == np.arange(2)
    of_soles = inner_contacts(told) & (slower | ~told.all(axis=1, keepdims=True))
    return (inner_contacts(motion.contacts) if motion.labelled else of_soles), of_soles


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


def label_disagreement(motion: Motion, settings: FootSettings) -> tuple[Verdict, ...]:
    """Share of foot-frames where label and sole disagree on contact; 0 for a clip without labels.

    None where the contacts are those of a simulation.
    """
    if motion.simulated:
        return ()
    value = float(np.mean(motion.told_contacts != motion.contacts))
    return (
        Verdict(
            code="contact_disagreement",
            value=value,
            limit=motion.largest_share(settings.disagreement),
            unit="of foot-frames",
            text=f"contact labels and the soles' motion disagree in {100 * value:.0f} % of the foot-frames",
        ),
    )


def _mean_slip(
    code: str,
    feet: str,
    slip: Float[np.ndarray, "t 2"],
    standing: Bool[np.ndarray, "t 2"],
    limits: tuple[float, float],
    motion: Motion,
) -> Verdict:
    """Mean slip [m/s] of the feet that are held to stand."""
    speed, found = motion.ground_speed, slip[standing]
    value, limit = float(found.mean()) if found.size else 0.0, limits[0] + limits[1] * speed
    return Verdict(
        code=code,
        value=value,
        limit=limit,
        unit="m/s",
        text=f"{feet} slide, at {speed:.2f} m/s over ground, at {value:.2f} m/s on average",
        bad=_sliding_stances(slip, standing, limit),
    )


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
