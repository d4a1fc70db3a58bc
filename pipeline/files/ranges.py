"""What the values of settings may be. A settings dataclass checks itself in `__post_init__`, all faults at once.

    def __post_init__(self) -> None:
        check(self, increasing(self, "low", "high"), label_hz=Range(1.0, 1000.0), skills=OneOf(LABELS))

`pipeline.files.settings.read` turns the faults of all dataclasses of a file into one SettingsError. What is None or not
there (optional, or already refused by its type) is not looked at, so that every other fault of the file is still
found: `__post_init__` of a settings dataclass asks `check` and nothing else.
"""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from pipeline.errors import PipelineError


class RangeError(PipelineError):
    """Settings with values that they may not have.

    Args:
        faults: of each the key, counted from the object that holds it, and a sentence without the key
    """

    def __init__(self, faults: list[tuple[str, str]]):
        self.faults = tuple(faults)
        super().__init__("; ".join(f"'{key}' {problem}" for key, problem in faults) + ".")


class Allowed(ABC):
    """What one value may be."""

    @abstractmethod
    def problem(self, value: Any) -> str | None:
        """What is wrong with the value, as `is 3, allowed is …`; None if nothing is."""


@dataclass(frozen=True)
class Range(Allowed):
    """Numbers from `low` to `high`; of the open ones the bound itself is not allowed."""

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False

    def problem(self, value: Any) -> str | None:
        if (self.low < value if self.open_low else self.low <= value) and value <= self.high:
            return None
        return f"is {value:g}, allowed is {self}"

    def __str__(self) -> str:
        low = f"{'more than' if self.open_low else 'at least'} {self.low:g}"
        if self.high == math.inf:
            return low
        if self.low == -math.inf:
            return f"at most {self.high:g}"
        return f"{low} and at most {self.high:g}" if self.open_low else f"{self.low:g} to {self.high:g}"


POSITIVE = Range(0.0, open_low=True)
NOT_NEGATIVE = Range(0.0)
SHARE = Range(0.0, 1.0)
"""A share of a whole."""
PART = Range(0.0, 1.0, open_low=True)
"""A share that is not nothing."""
RATE_HZ = Range(1.0, 10_000.0)
"""Of frames, labels, filters; no recording of a body is slower or faster."""
COUNT = Range(1.0)


@dataclass(frozen=True)
class OneOf(Allowed):
    """One of some names."""

    names: tuple[str, ...]

    def problem(self, value: Any) -> str | None:
        return None if value in self.names else f"is {value!r}, there are: {', '.join(self.names)}"


@dataclass(frozen=True)
class Pattern(Allowed):
    """A pattern of names as `fnmatch` reads it: `*`, `?`, `[…]`."""

    def problem(self, value: Any) -> str | None:
        text = str(value)
        if not text.strip() or text != text.strip():
            return f"is {value!r}, allowed is a pattern that is not empty and has no blanks around it"
        return f"is {value!r}, its '[' has no ']'" if "[" in text and "]" not in text[text.index("[") :] else None


@dataclass(frozen=True)
class Keys:
    """A mapping: what its keys and its values may be."""

    keys: Allowed
    values: Allowed


def check(settings: Any, *more: list[tuple[str, str]], **allowed: Allowed | Keys) -> None:
    """Hold fields against what they may be, every entry of a list or a mapping by itself.

    Args:
        settings: the dataclass
        more: further faults, as `increasing` gives them
        allowed: name of a field -> what it may be

    Raises RangeError with every fault.
    """
    faults = [fault for name, what in allowed.items() for fault in _faults(name, getattr(settings, name, None), what)]
    faults += itertools.chain(*more)
    if faults:
        raise RangeError(faults)


def increasing(settings: Any, *names: str) -> list[tuple[str, str]]:
    """Faults of fields that have to grow from one to the next."""
    faults = []
    for one, two in itertools.pairwise(names):
        low, high = getattr(settings, one, None), getattr(settings, two, None)
        if low is not None and high is not None and not low < high:
            faults.append((two, f"is {high:g}, allowed is more than '{one}' ({low:g})"))
    return faults


def _faults(where: str, value: Any, allowed: Allowed | Keys) -> list[tuple[str, str]]:
    if value is None:
        return []
    if isinstance(value, dict):
        keys = _faults_of_keys(where, value, allowed.keys) if isinstance(allowed, Keys) else []
        each = allowed.values if isinstance(allowed, Keys) else allowed
        return keys + [fault for key, entry in value.items() for fault in _faults(f"{where}.{key}", entry, each)]
    if isinstance(value, (list, tuple)):
        return [fault for i, entry in enumerate(value) for fault in _faults(f"{where}[{i}]", entry, allowed)]
    problem = None if isinstance(allowed, Keys) else allowed.problem(value)
    return [] if problem is None else [(where, problem)]


def _faults_of_keys(where: str, value: dict[str, Any], allowed: Allowed) -> list[tuple[str, str]]:
    found = ((key, allowed.problem(key)) for key in value)
    return [(f"{where}.{key}", f"has a key that {problem}") for key, problem in found if problem is not None]
