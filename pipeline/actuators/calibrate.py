"""Calibrate a motor from its measurement file: its knee, or the reasons against it."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.actuators.knee_fit import Interval, KneeFit, fit_knee
from pipeline.actuators.motor_table import Motor
from pipeline.actuators.read_measurement import Measurement, read_measurement
from pipeline.actuators.settings import ActuatorSettings, KneeSettings
from pipeline.errors import FileError

NO_FALL = "no knee: the sweep ends before the fall"


def reasons_against(measurement: Measurement, fit: KneeFit, settings: KneeSettings) -> tuple[str, ...]:
    """Reasons to refuse the knee of a sweep; empty if it is accepted."""
    if not fit.knee_torque.value > 0.0:
        return (f"the torque at the knee would be {fit.knee_torque.value:.2f} N m",)
    no_fall = _no_fall(measurement, fit, settings)
    return (*no_fall, *_uncertain(fit, settings), *_directions(measurement, settings))


def _no_fall(measurement: Measurement, fit: KneeFit, settings: KneeSettings) -> list[str]:
    knee, speed = fit.knee_speed.value, measurement.speed
    beyond = int(np.sum(speed[~fit.outlier] > min(knee, fit.knee_speed.low)))
    rest = float(speed.max() - knee) / float(np.ptp(speed))
    last = float(fit.torque(speed.max(keepdims=True))[0]) / fit.knee_torque.value
    against = []
    if beyond < settings.fall_points:
        against.append(
            f"{NO_FALL}; {beyond} points are beyond {knee:.2f} rad/s, expected at least {settings.fall_points}"
        )
    if rest < settings.fall_range:
        expected = f"expected at least {100 * settings.fall_range:.0f} %"
        against.append(f"{NO_FALL}; {100 * rest:.0f} % of the speeds are beyond {knee:.2f} rad/s, {expected}")
    if last > settings.last_torque:
        expected = f"expected less than {100 * settings.last_torque:.0f} %"
        against.append(f"{NO_FALL}; at its end are {100 * last:.0f} % of the knee torque, {expected}")
    if fit.fall_slope >= 0.0 or -fit.fall_slope < settings.slope_ratio * abs(fit.plateau_slope):
        slopes = f"{fit.fall_slope:.3g} N m s/rad beyond {knee:.2f} rad/s and by {fit.plateau_slope:.3g} before"
        expected = f"a fall {settings.slope_ratio:g} times as steep is required"
        against.append(f"no knee: the torque changes by {slopes}; {expected}")
    return against


def _uncertain(fit: KneeFit, settings: KneeSettings) -> list[str]:
    knee, against = fit.knee_speed, []
    if knee.width > settings.interval:
        place = f"{knee.low:.2f} to {knee.high:.2f} rad/s, {100 * knee.width:.0f} % of it"
        against.append(f"the knee may lie at {place}; at most {100 * settings.interval:.0f} % are allowed")
    if fit.no_load_speed <= settings.no_load_ratio * knee.value:
        end = f"less than {settings.no_load_ratio:g} times the knee's {knee.value:.2f}"
        problem = "the DC-motor form has no finite saturation torque"
        against.append(f"the torque ends at {fit.no_load_speed:.2f} rad/s, {end}: {problem}")
    share = float(fit.outlier.mean())
    if share > settings.max_outliers:
        allowed = f"at most {100 * settings.max_outliers:.0f} % are allowed"
        against.append(f"{100 * share:.0f} % of the points are outliers; {allowed}")
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
            values = f"{one:.2f} {unit} in the positive and {other:.2f} {unit} in the negative direction"
            allowed = f"{100 * settings.directions:.0f} % are allowed"
            against.append(f"the {what.replace('_', ' ')} is {values}; {allowed}")
    return against


IDLE_SPEED = 1.03
"""Ratio to the no-load speed above which a point may belong to a dragged motor."""
IDLE_TORQUE = 0.1
"""Torque relative to the knee's below which such a point belongs to a dragged motor."""
MAX_TRIMS = 6


SYNTHETIC = "synthetic: never measured"
"""Note on a calibration from a file that states that its points were not measured."""


@dataclass(frozen=True, kw_only=True)
class Knee:
    """Result of a sweep, with 95 % intervals. Speeds in rad/s, torques in N m."""

    speed: Interval
    torque: Interval
    no_load_speed: float
    stall_torque: float
    """Torque of the plateau at rest [N m]."""
    noise: float
    """Standard deviation of the points over the knee torque."""
    outliers: int


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A calibrated motor. `knee` is None if nothing could be fitted; a present knee may still be refused."""

    motor: str
    joints: tuple[str, ...]
    armature: float | None
    """[kg m^2]; None if the motor's gear or rotor is not known."""
    knee: Knee | None
    reasons: tuple[str, ...]
    """Reasons to refuse the knee; empty if it is accepted."""
    notes: tuple[str, ...]
    """Remarks, such as omitted braking points or a synthetic sweep."""
    speed: tuple[float, ...] = ()
    """Joint speed of the points, magnitude [rad/s]."""
    torque: tuple[float, ...] = ()
    """Joint torque of the points, magnitude [N m]."""
    forward: tuple[bool, ...] = ()
    outlier: tuple[bool, ...] = ()

    @property
    def accepted(self) -> bool:
        return self.knee is not None and not self.reasons

    @property
    def synthetic(self) -> bool:
        """Whether the sweep is synthetic, not measured."""
        return SYNTHETIC in self.notes

    @property
    def verdict(self) -> str:
        """`calibrated`, or `refused: ` and the reasons."""
        return "calibrated" if self.accepted else "refused: " + "; ".join(self.reasons)

    @staticmethod
    def from_dict(value: dict[str, Any]) -> "Calibration":
        """Inverse of `settings.plain`."""
        plain: dict[str, Any] = {name: tuple(each) if isinstance(each, list) else each for name, each in value.items()}
        if (knee := plain["knee"]) is not None:
            intervals = {name: Interval(**knee[name]) for name in ("speed", "torque")}
            plain["knee"] = Knee(**{**knee, **intervals})
        return Calibration(**plain)


def calibrate(text: str | None, file: str, motor: Motor, settings: ActuatorSettings) -> Calibration:
    """The calibration of a motor from the text of its measurement file (None: there is none).

    An unreadable file is a refusal with a reason, not an error: the motor keeps the model's limits.
    """
    found = Calibration(motor=motor.name, joints=motor.joints, armature=motor.armature, knee=None, reasons=(), notes=())
    if text is None:
        return dataclasses.replace(found, reasons=(f"{file}: there is no such measurement file",))
    try:
        measurement = read_measurement(text, file, motor, settings.reading)
    except FileError as error:
        return dataclasses.replace(found, reasons=(str(error),))
    count, different = len(measurement.speed), len(np.unique(measurement.speed))
    if min(count, different) < settings.knee.min_points:
        reason = f"{count} points at {different} speeds; {settings.knee.min_points} are required"
        knee, reasons, outlier = None, (reason,), np.zeros(count, dtype=bool)
    else:
        measurement, fit = fit_sweep(measurement, settings.knee)
        knee, reasons, outlier = _knee(fit), reasons_against(measurement, fit, settings.knee), fit.outlier
    return dataclasses.replace(
        found,
        knee=knee,
        reasons=reasons,
        notes=(*([SYNTHETIC] if measurement.synthetic else []), *measurement.notes),
        speed=tuple(measurement.speed.tolist()),
        torque=tuple(measurement.torque.tolist()),
        forward=tuple(measurement.forward.tolist()),
        outlier=tuple(outlier.tolist()),
    )


def fit_sweep(measurement: Measurement, settings: KneeSettings) -> tuple[Measurement, KneeFit]:
    """Fit the knee without points beyond the no-load speed; return the remaining sweep and the fit.

    Beyond the no-load speed the motor is dragged; such points would flatten the falling line. They are removed
    repeatedly until none is left.
    """
    whole = len(measurement.speed)
    fit = fit_knee(measurement.speed, measurement.torque, settings.outlier)
    for _ in range(MAX_TRIMS):
        small = np.abs(measurement.torque) < IDLE_TORQUE * abs(fit.knee_torque.value)
        idle = small & (measurement.speed > IDLE_SPEED * fit.no_load_speed)
        if not idle.any() or len(np.unique(measurement.speed[~idle])) < settings.min_points:
            break
        note = f"{whole - int((~idle).sum())} points beyond the no-load speed left out"
        kept = {name: getattr(measurement, name)[~idle] for name in ("speed", "torque", "forward")}
        notes = (*(each for each in measurement.notes if "no-load" not in each), note)
        measurement = dataclasses.replace(measurement, **kept, notes=notes)
        fit = fit_knee(measurement.speed, measurement.torque, settings.outlier)
    return measurement, fit


def _knee(fit: KneeFit) -> Knee | None:
    if not fit.knee_torque.value > 0.0 or not np.isfinite(fit.no_load_speed):
        return None
    return Knee(
        speed=fit.knee_speed,
        torque=fit.knee_torque,
        no_load_speed=fit.no_load_speed,
        stall_torque=fit.stall_torque,
        noise=fit.noise / fit.knee_torque.value,
        outliers=int(fit.outlier.sum()),
    )
