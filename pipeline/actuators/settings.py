"""Thresholds of actuator calibration; values and sources are in `data/actuators.yaml`."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ReadingSettings:
    """Limits on a measurement file."""

    max_speed: float
    """Joint speed above which another unit or the motor's side is assumed [rad/s]."""
    max_torque: float
    """Joint torque above which another unit is assumed [N m]."""
    braking_torque: float
    """A torque against the motion above this share of the largest is braking and left out; below, noise."""
    clustered: float
    """Share of points within a tenth of the largest value from which a column is a plateau."""
    voltage_spread: float
    """Largest spread of the supply voltage over its mean; beyond, the points are of several curves."""
    temperature_spread: float
    """Largest spread of the temperature [K]."""


@dataclass(frozen=True, kw_only=True)
class KneeSettings:
    """Conditions for accepting a knee."""

    min_points: int
    """Least points of a sweep."""
    fall_points: int
    """Least points beyond the knee."""
    fall_range: float
    """Least part of the speed range beyond the knee."""
    slope_ratio: float
    """Least slope of the fall over that of the plateau."""
    last_torque: float
    """Largest torque of the fit at the end of the sweep over that of the knee."""
    interval: float
    """Largest width of the 95 % interval of the knee speed over the speed."""
    directions: float
    """Largest difference of the two directions' knees over their mean."""
    no_load_ratio: float
    """Least no-load speed over knee speed."""
    outlier: float
    """A point further from the fit than this many standard deviations is an outlier."""
    max_outliers: float
    """Largest share of outliers."""


@dataclass(frozen=True, kw_only=True)
class ModelSettings:
    """Limits on values that enter a robot model."""

    gear_ratio: tuple[float, float]
    rotor_inertia: tuple[float, float]
    """[kg m^2]"""
    armature: tuple[float, float]
    """[kg m^2]"""
    nominal_factor: float
    """Ratio of a knee to the model's limit from which a wrong unit or side is assumed."""


@dataclass(frozen=True, kw_only=True)
class ActuatorSettings:
    """`data/actuators.yaml`."""

    reading: ReadingSettings
    knee: KneeSettings
    model: ModelSettings
