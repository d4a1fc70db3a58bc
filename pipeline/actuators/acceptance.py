"""Acceptance of a knee: every reason against it, with value and limit."""

from __future__ import annotations

import numpy as np

from pipeline.actuators.knee_fit import KneeFit, fit_knee
from pipeline.actuators.measurement import Measurement
from pipeline.actuators.settings import KneeSettings

NO_FALL = "no knee: the sweep ends before the fall"


def reasons_against(measurement: Measurement, fit: KneeFit, settings: KneeSettings) -> tuple[str, ...]:
    """Reasons to refuse the knee of a sweep; empty if it is accepted."""
    return (
        *_no_fall(measurement, fit, settings),
        *_uncertain(fit, settings),
        *_directions(measurement, settings),
    )


def _no_fall(measurement: Measurement, fit: KneeFit, settings: KneeSettings) -> list[str]:
    knee, speed = fit.knee_speed.value, measurement.speed
    beyond = int(np.sum(speed[~fit.outlier] > min(knee, fit.knee_speed.low)))
    rest = float(speed.max() - knee) / float(np.ptp(speed))
    last = float(fit.torque(speed.max(keepdims=True))[0]) / fit.knee_torque.value
    against = []
    if beyond < settings.fall_points:
        against.append(f"{NO_FALL}; {beyond} points are beyond {knee:.2f} rad/s, wanted {settings.fall_points}")
    if rest < settings.fall_range:
        against.append(
            f"{NO_FALL}; {100 * rest:.0f} % of the speeds are beyond {knee:.2f} rad/s, wanted "
            f"{100 * settings.fall_range:.0f} %"
        )
    if last > settings.last_torque:
        against.append(
            f"{NO_FALL}; at its end are {100 * last:.0f} % of the knee torque, wanted less than "
            f"{100 * settings.last_torque:.0f} %"
        )
    if fit.fall_slope >= 0.0 or -fit.fall_slope < settings.slope_ratio * abs(fit.plateau_slope):
        against.append(
            f"no knee: the torque changes by {fit.fall_slope:.3g} N m s/rad beyond {knee:.2f} rad/s and by "
            f"{fit.plateau_slope:.3g} before; a fall {settings.slope_ratio:g} times as steep is wanted"
        )
    return against


def _uncertain(fit: KneeFit, settings: KneeSettings) -> list[str]:
    knee, against = fit.knee_speed, []
    if knee.width > settings.interval:
        against.append(
            f"the knee may lie at {knee.low:.2f} to {knee.high:.2f} rad/s, {100 * knee.width:.0f} % of it; at most "
            f"{100 * settings.interval:.0f} % are allowed"
        )
    if fit.knee_torque.value <= 0.0:
        against.append(f"the torque at the knee would be {fit.knee_torque.value:.2f} N m")
    elif fit.no_load_speed <= settings.no_load_ratio * knee.value:
        against.append(
            f"the torque ends at {fit.no_load_speed:.2f} rad/s, less than {settings.no_load_ratio:g} times the knee's "
            f"{knee.value:.2f}: the DC-motor form has no finite saturation torque"
        )
    share = float(fit.outlier.mean())
    if share > settings.max_outliers:
        against.append(
            f"{100 * share:.0f} % of the points are outliers; at most {100 * settings.max_outliers:.0f} % are allowed"
        )
    return against


def _directions(measurement: Measurement, settings: KneeSettings) -> list[str]:
    """Compare the knees of both directions if both have enough points."""
    fits = []
    for forward in (True, False):
        speed, torque = measurement.direction(forward)
        if len(speed) < settings.min_points or len(np.unique(speed)) < settings.min_points:
            return []
        fits.append(fit_knee(speed, torque, settings.outlier))
    against = []
    for what, unit in (("knee_speed", "rad/s"), ("knee_torque", "N m")):
        one, other = (getattr(fit, what).value for fit in fits)
        if abs(one - other) > settings.directions * 0.5 * abs(one + other):
            against.append(
                f"the {what.replace('_', ' ')} is {one:.2f} {unit} in the positive and {other:.2f} {unit} in the "
                f"negative direction; {100 * settings.directions:.0f} % are allowed"
            )
    return against
