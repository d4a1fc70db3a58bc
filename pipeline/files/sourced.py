"""Numbers of settings that bear their unit and where they come from.

A field says by its type that it does: `Annotated[float, Unit("rad")]`. The file then has for it

    limit_excess: {value: 0.05, unit: rad, source: cal, why: "MuJoCo's limits are soft"}

and the settings object the bare number: another sentence is no other setting. `origins` gives unit, source and reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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
    """What a number is measured in; a file that says another unit is refused."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """How a figure carries over to a robot of another size: times (ratio of leg lengths)^`length` times (ratio of
    masses)^`mass`. The exponents are those of dynamic similarity under the same gravity."""

    length: float
    mass: float = 0.0
    first_only: bool = False
    """Of a pair a + b times the speed, only a scales."""

    def factor(self, length_ratio: float, mass_ratio: float) -> float:
        """The factor on the figure."""
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
    """As the file has it: a number, or a list of them."""
    unit: str
    source: str
    """One of `SOURCES`."""
    why: str
    """Where the value comes from, as a sentence."""


def value_of(entry: Any, unit: Unit, where: str, faults: list[str]) -> Any:
    """The value of a number with unit and source, None where there is none; what is wrong is added to `faults`."""
    if not isinstance(entry, dict):
        form = f"{{value: …, unit: {unit.name}, source: {' | '.join(SOURCES)}, why: …}}"
        faults.append(f"'{where}' is {entry!r}, wanted {form}")
        return None
    faults += [f"unknown key '{where}.{key}', there are: {', '.join(_KEYS)}" for key in entry if key not in _KEYS]
    faults += [f"'{where}.{key}' is missing" for key in _KEYS if key not in entry]
    if entry.get("unit", unit.name) != unit.name:
        faults.append(f"'{where}.unit' is {entry['unit']!r}, wanted {unit.name!r}")
    if entry.get("source", "cal") not in tuple(SOURCES):
        faults.append(f"'{where}.source' is {entry['source']!r}, there are: {', '.join(SOURCES)}")
    if "why" in entry and not (isinstance(entry["why"], str) and entry["why"].strip()):
        faults.append(f"'{where}.why' is {entry['why']!r}, wanted a sentence")
    return entry.get("value")


def origins(entry: Any, where: str = "") -> dict[str, Origin]:
    """Unit, source and reason of every number of a settings file, by its dotted name (`joints.limit_excess`).

    Args:
        entry: what `settings.read_yaml` gave, of a file that `settings.read` took
    """
    if not isinstance(entry, dict):
        return {}
    if set(entry) == set(_KEYS):
        return {where: Origin(**entry)}
    prefix = f"{where}." if where else ""
    return {name: found for key, each in entry.items() for name, found in origins(each, f"{prefix}{key}").items()}
