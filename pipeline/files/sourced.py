"""Settings with unit, source and reason.

A field with `Annotated[float, Unit("rad")]` is written in the file as

    limit_excess: {value: 0.05, unit: rad, source: cal, why: "MuJoCo's limits are soft"}

and is a bare number in the settings object, so that a changed `why` does not change the settings. `origins` gives unit,
source and reason.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema, core_schema

from pipeline.files.ranges import UNKNOWN, RangeError, faults_of

SOURCES = {
    "cal": "calibrated: so that known good motion holds it and planted faults do not",
    "lit": "published",
    "phys": "follows from physics or from the robot's size",
    "judge": "judgement",
}
"""Kinds of sources and what they mean."""

_KEYS = ("value", "unit", "source", "why")


@dataclass(frozen=True)
class Unit:
    """Unit of a number; a file that states another unit is rejected. Must be the last metadata in an annotation, so
    that all faults of a number are found at once."""

    name: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(self._value, handler(source))

    def _value(self, entry: Any, check: Callable[[Any], Any]) -> Any:
        """The value of `{value, unit, source, why}`. Raises RangeError with every fault."""
        if not isinstance(entry, dict):
            form = f"{{value: …, unit: {self.name}, source: {' | '.join(SOURCES)}, why: …}}"
            raise RangeError([("", f"is {entry!r}, expected {form}")])
        faults = [(f".{key}", f"{UNKNOWN}, there are: {', '.join(_KEYS)}") for key in entry if key not in _KEYS]
        faults += [(f".{key}", "is missing") for key in _KEYS if key not in entry]
        if entry.get("unit", self.name) != self.name:
            faults.append((".unit", f"is {entry['unit']!r}, expected {self.name!r}"))
        if entry.get("source", "cal") not in tuple(SOURCES):
            faults.append((".source", f"is {entry['source']!r}, there are: {', '.join(SOURCES)}"))
        if "why" in entry and not (isinstance(entry["why"], str) and entry["why"].strip()):
            faults.append((".why", f"is {entry['why']!r}, expected a sentence"))
        value = None
        if "value" in entry:
            try:
                value = check(_tuples(entry["value"]))
            except ValidationError as error:
                faults += faults_of(error)
        if faults:
            raise RangeError(faults)
        return value


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """Scaling of a value to a robot of another size: times (ratio of leg lengths)^`length` times (ratio of
    masses)^`mass`. The exponents follow from dynamic similarity under the same gravity."""

    length: float
    mass: float = 0.0
    first_only: bool = False
    """Whether, in a pair for a + b times the speed, only a is scaled."""

    def factor(self, length_ratio: float, mass_ratio: float) -> float:
        """The factor on the value."""
        return length_ratio**self.length * mass_ratio**self.mass


LENGTH = Scaled(length=1.0)
SPEED = Scaled(length=0.5)
SPEED_AND_SHARE = Scaled(length=0.5, first_only=True)
JERK = Scaled(length=-0.5)
PER_AREA = Scaled(length=-2.0)
IMPULSE = Scaled(length=0.5, mass=1.0)
TORQUE = Scaled(length=1.0, mass=1.0)


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Unit, source and reason of a number."""

    value: Any
    """Value in the file: a number or a list of numbers."""
    unit: str
    source: str
    """One of `SOURCES`."""
    why: str
    """Reason for the value, as a sentence."""


def origins(entry: Any, where: str = "") -> dict[str, Origin]:
    """Unit, source and reason of each number by its dotted name (`joints.limit_excess`), from `settings.read_yaml`."""
    if not isinstance(entry, dict):
        return {}
    if set(entry) == set(_KEYS):
        return {where: Origin(**entry)}
    prefix = f"{where}." if where else ""
    return {name: found for key, each in entry.items() for name, found in origins(each, f"{prefix}{key}").items()}


def _tuples(value: Any) -> Any:
    """Convert lists to tuples, as required by strict validation of Python objects."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
