"""Limit cycles of a walk's joints: extraction from a record, and comparison of two.

    JointSeries (a leg's hip pitch and knee over time)
      -> period by autocorrelation -> phase of the hip's fundamental -> cycles cut at equal phase -> LimitCycle
    two LimitCycles -> Comparison: shape distance, period, amplitude

A cycle is a stride of one leg. Definitions:

- **period**: mean time from one phase 0 of the hip's fundamental to the next [s];
- **amplitude** of an angle: largest less smallest value of the mean cycle [rad];
- **spread**: root of the mean squared distance of the single cycles from the mean one, in the plane hip-knee [rad];
- **shape distance** of two closed curves a and b in a plane, both centred, P points each at equal phase: the smallest
  root of the mean squared distance |a(i) - b(i + s)| over all shifts s, as a share of the curves' size, which is the
  root of the mean squared distance from their centres, of both together. 0: the same shape and size, regardless of
  position and duration; sqrt(2): the same circle in the opposite direction.
- **offset**: distance of the centres in the plane hip-knee [rad].

Planes: hip against knee [rad], and each angle against its speed times T / 2 pi of its own walk [rad], in which a sine
is a circle at any cadence.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float

from pipeline.errors import PipelineError
from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, check, increasing


@dataclass(frozen=True, kw_only=True)
class LimitCycleSettings:
    """The whole file."""

    speeds_m_s: Annotated[tuple[float, ...], POSITIVE]
    """Forward commands at which engines are compared."""
    seconds: Annotated[float, POSITIVE]
    """Length of a walk in simulation [s]."""
    settled_s: Annotated[float, NOT_NEGATIVE]
    """Start of a walk that is excluded: standing, acceleration, settling [s]."""
    timestep_s: Annotated[float, POSITIVE]
    friction: Annotated[float, POSITIVE]
    command_tolerance: Annotated[float, POSITIVE]
    """Largest deviation of a log's command on any axis [m/s, rad/s]."""

    def __post_init__(self) -> None:
        check(increasing(self, "settled_s", "seconds"))


PHASES = 100
"""Points of a cycle."""
SHORTEST_S, LONGEST_S = 0.3, 2.5
"""Range of periods [s]; trembling is faster, swaying slower than walking."""
LEAST_LIKENESS = 0.6
"""Least autocorrelation at the period for a record to count as periodic."""
LEAST_CYCLES = 3

HIP, KNEE, HIP_VEL, KNEE_VEL = range(4)
PLANES = ("hip against knee", "hip against its speed", "knee against its speed")


class NoCycleError(PipelineError):
    """A record without a cycle.

    Args:
        name: name of the record
        problem: what was found instead
    """

    def __init__(self, name: str, problem: str):
        self.problem = problem
        super().__init__(f"{name}: no limit cycle: {problem}.")


@dataclass(frozen=True, kw_only=True)
class JointSeries:
    """One leg's hip pitch and knee [rad] and their speeds [rad/s] at a steady command."""

    name: str
    rate_hz: float
    hip: Float[np.ndarray, " n"]
    knee: Float[np.ndarray, " n"]
    hip_vel: Float[np.ndarray, " n"]
    knee_vel: Float[np.ndarray, " n"]

    @property
    def table(self) -> Float[np.ndarray, "n 4"]:
        """Columns HIP, KNEE, HIP_VEL, KNEE_VEL."""
        return np.stack([self.hip, self.knee, self.hip_vel, self.knee_vel], axis=1)


def leg_series(
    name: str, hip: int, knee: int, rate_hz: float, joint_pos: np.ndarray, joint_vel: np.ndarray
) -> JointSeries:
    """One leg of all joints' positions and velocities (t, j), `hip` and `knee` being the indices of its joints."""
    pos, vel = np.asarray(joint_pos, dtype=float), np.asarray(joint_vel, dtype=float)
    turns = {"hip": pos[:, hip], "knee": pos[:, knee], "hip_vel": vel[:, hip], "knee_vel": vel[:, knee]}
    return JointSeries(name=name, rate_hz=float(rate_hz), **turns)


@dataclass(frozen=True, kw_only=True)
class LimitCycle:
    """The mean stride of a record."""

    name: str
    cycles: int
    period_s: float
    period_std_s: float
    mean: Float[np.ndarray, "p 4"]
    """At equal steps of phase: hip, knee [rad] and their speeds [rad/s]."""
    spread_rad: float

    @property
    def hip_amplitude_rad(self) -> float:
        return float(np.ptp(self.mean[:, HIP]))

    @property
    def knee_amplitude_rad(self) -> float:
        return float(np.ptp(self.mean[:, KNEE]))

    def plane(self, name: str) -> Float[np.ndarray, "p 2"]:
        """The closed curve in one of `PLANES` [rad]."""
        if name == PLANES[0]:
            return self.mean[:, [HIP, KNEE]]
        angle, speed = (HIP, HIP_VEL) if name == PLANES[1] else (KNEE, KNEE_VEL)
        return np.stack([self.mean[:, angle], self.mean[:, speed] * self.period_s / (2.0 * math.pi)], axis=1)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A cycle compared with a reference."""

    name: str
    reference: str
    shape_distance: dict[str, float]
    """By plane."""
    offset_rad: float
    period_ratio: float
    """Ratio of the other's period to the reference's."""
    hip_amplitude_ratio: float
    knee_amplitude_ratio: float


def limit_cycle(series: JointSeries) -> LimitCycle:
    """The cycle of a record. Raises NoCycleError if it is not periodic or has too few cycles."""
    table = series.table
    if not np.isfinite(table).all():
        raise NoCycleError(series.name, "some of its numbers are not finite")
    period_s = _period(series)
    starts = _phase_zeros(series.hip, series.rate_hz, period_s)
    if len(starts) < LEAST_CYCLES + 1:
        raise NoCycleError(series.name, f"{max(len(starts) - 1, 0)} whole cycles, expected at least {LEAST_CYCLES}")
    cycles = np.array([_resampled(table, *pair) for pair in itertools.pairwise(starts)])
    lengths = np.diff(starts) / series.rate_hz
    mean = cycles.mean(axis=0)
    away = cycles[:, :, [HIP, KNEE]] - mean[:, [HIP, KNEE]]
    return LimitCycle(
        name=series.name,
        cycles=len(cycles),
        period_s=float(lengths.mean()),
        period_std_s=float(lengths.std()),
        mean=mean,
        spread_rad=float(np.sqrt(np.mean(np.sum(away**2, axis=-1)))),
    )


def compare(reference: LimitCycle, other: LimitCycle) -> Comparison:
    """Compare `other` with `reference`."""
    between = reference.mean[:, [HIP, KNEE]].mean(axis=0) - other.mean[:, [HIP, KNEE]].mean(axis=0)
    return Comparison(
        name=other.name,
        reference=reference.name,
        shape_distance={name: shape_distance(reference.plane(name), other.plane(name)) for name in PLANES},
        offset_rad=float(np.linalg.norm(between)),
        period_ratio=other.period_s / reference.period_s,
        hip_amplitude_ratio=other.hip_amplitude_rad / max(reference.hip_amplitude_rad, 1e-9),
        knee_amplitude_ratio=other.knee_amplitude_rad / max(reference.knee_amplitude_rad, 1e-9),
    )


def shape_distance(one: Float[np.ndarray, "p 2"], two: Float[np.ndarray, "p 2"]) -> float:
    """Shape distance of two closed curves as defined above; symmetric in its arguments."""
    a, b = (curve - curve.mean(axis=0) for curve in (one, two))
    size = np.mean(np.sum(a**2, axis=1)) + np.mean(np.sum(b**2, axis=1))
    products = sum(np.fft.ifft(np.conj(np.fft.fft(a[:, i])) * np.fft.fft(b[:, i])).real for i in range(2))
    squared = size - 2.0 * float(np.max(products)) / len(a)
    return math.sqrt(max(squared, 0.0) / max(size / 2.0, 1e-12))


def _period(series: JointSeries) -> float:
    """The lag [s] with the highest autocorrelation of hip and knee; the first of nearly equal peaks."""
    centred = np.stack([series.hip, series.knee], axis=1)
    centred = centred - centred.mean(axis=0)
    first = math.ceil(SHORTEST_S * series.rate_hz)
    last = min(math.floor(LONGEST_S * series.rate_hz), len(centred) // 2)
    if last <= first + 2:
        raise NoCycleError(series.name, f"{len(centred) / series.rate_hz:.1f} s are too short")
    likeness = np.array([_likeness(centred, lag) for lag in range(first - 1, last + 2)])
    inner = likeness[1:-1]
    peaks = np.flatnonzero((inner >= likeness[:-2]) & (inner > likeness[2:])) + 1
    best = float(likeness[peaks].max()) if len(peaks) else 0.0
    if best < LEAST_LIKENESS:
        problem = f"its likeness to itself is {best:.2f} at best, expected at least {LEAST_LIKENESS}"
        raise NoCycleError(series.name, problem)
    peak = int(peaks[np.flatnonzero(likeness[peaks] >= 0.95 * best)[0]])
    before, at, after = likeness[peak - 1 : peak + 2]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return (first - 1 + peak + shift) / series.rate_hz


def _likeness(values: np.ndarray, lag: int) -> float:
    early, late = values[:-lag], values[lag:]
    norm = math.sqrt(float(np.sum(early**2)) * float(np.sum(late**2)))
    return float(np.sum(early * late)) / norm if norm > 1e-12 else 0.0


def _phase_zeros(hip: np.ndarray, rate_hz: float, period_s: float) -> Float[np.ndarray, " c"]:
    """Sample positions, between samples, at which the phase of the fundamental of the hip is a multiple of 2 pi.

    The phase at a time is that of the record's Fourier sum over the two periods around it, under a Hann window.
    """
    omega = 2.0 * math.pi / (period_s * rate_hz)
    half = math.ceil(period_s * rate_hz)
    window = np.hanning(2 * half + 1)
    index = np.arange(len(hip))
    if len(hip) < len(window):
        return np.zeros(0)
    turned = (hip - hip.mean()) * np.exp(-1j * omega * index)
    slow = np.convolve(turned, window, mode="valid")
    at = index[half : half + len(slow)]
    phase = (np.unwrap(np.angle(slow)) + omega * at) / (2.0 * math.pi)
    whole = np.arange(math.ceil(phase[0]), math.floor(phase[-1]) + 1)
    rising = np.maximum.accumulate(phase)
    return np.interp(whole, rising, at)


def _resampled(table: np.ndarray, start: float, stop: float) -> Float[np.ndarray, "p 4"]:
    places = start + (stop - start) * np.arange(PHASES) / PHASES
    index = np.arange(len(table))
    return np.stack([np.interp(places, index, column) for column in table.T], axis=1)
