"""Scale settings to the size of a robot.

Thresholds were calibrated on one robot. A settings file states its size in `calibrated_on`, and the fields that depend
on it are annotated with `Scaled`; `scaled` converts them to another robot. For the robot that a file was calibrated on,
all values are exactly those of the file.
"""

import dataclasses
import typing
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeVar, runtime_checkable

from pipeline.files.ranges import POSITIVE
from pipeline.files.sourced import Scaled, Unit
from pipeline.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class RobotSize:
    """Size of the robot that settings were calibrated on."""

    leg_length: Annotated[float, POSITIVE, Unit("m")]
    """`Robot.leg_length` [m]."""
    mass: Annotated[float, POSITIVE, Unit("kg")]
    """Total mass, to 1 g [kg]."""


def size_of(robot: Robot) -> RobotSize:
    return RobotSize(leg_length=robot.leg_length, mass=round(robot.total_mass, 3))


def ratios_to(known: RobotSize, robot: Robot) -> tuple[RobotSize, tuple[float, float]]:
    """Size of a robot, and the ratios of its leg length and mass to a known size; exactly 1 for equal sizes."""
    size = size_of(robot)
    return size, (size.leg_length / known.leg_length, size.mass / known.mass)


@runtime_checkable
class Calibrated(Protocol):
    """Settings that state the size of the robot that they were calibrated on."""

    @property
    def calibrated_on(self) -> RobotSize: ...


S = TypeVar("S", bound=Calibrated)


def scaled(settings: S, robot: Robot) -> S:
    """The settings (a dataclass) for `robot`. Settings already scaled to it are returned unchanged."""
    size, ratios = ratios_to(settings.calibrated_on, robot)
    if settings.calibrated_on == size:
        return settings
    return dataclasses.replace(_scaled(settings, ratios), calibrated_on=size)


def _scaled(section: Any, ratios: tuple[float, float]) -> Any:
    hints = typing.get_type_hints(type(section), include_extras=True)
    changed = {}
    for field in dataclasses.fields(section):
        value = getattr(section, field.name)
        rules = [remark for remark in getattr(hints[field.name], "__metadata__", ()) if isinstance(remark, Scaled)]
        if dataclasses.is_dataclass(value):
            changed[field.name] = _scaled(value, ratios)
        elif rules:
            factor = rules[0].factor(*ratios)
            if not isinstance(value, tuple):
                changed[field.name] = factor * value
            else:
                last = 1.0 if rules[0].first_only else factor
                changed[field.name] = (factor * value[0], *(last * each for each in value[1:]))
    return dataclasses.replace(section, **changed)
