"""Allowed values of settings, as metadata in a field's annotation that `pipeline.files.settings` checks.

    label_hz: Annotated[float, Range(5.0, 1000.0)]
    skills: Annotated[tuple[str, ...], OneOf(LABELS)]

Every entry of a list or a mapping is checked by itself; None is not checked. Faults between the fields of a dataclass
are raised by its `__post_init__` (`check`).
"""

import dataclasses
import itertools
import math
import typing
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from pipeline.errors import PipelineError


class RangeError(PipelineError, ValueError):
    """Raised for settings with invalid values; `faults` are keys below the object, each with a sentence."""

    def __init__(self, faults: list[tuple[str, str]]):
        self.faults = tuple(faults)
        super().__init__("; ".join(f"'{key}' {problem}" for key, problem in faults) + ".")


class Remark(ABC):
    """Annotation metadata that checks values of the annotated type."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._checked, handler(source))

    def _checked(self, value: Any) -> Any:
        faults = self.faults("", value)
        if faults:
            raise RangeError(faults)
        return value

    @abstractmethod
    def faults(self, where: str, value: Any) -> list[tuple[str, str]]:
        """Faults of a value, of a list or of a mapping: the key from `where` on, and a sentence without the key."""


class Allowed(Remark):
    """Constraint on a single value."""

    def faults(self, where: str, value: Any) -> list[tuple[str, str]]:
        if value is None:
            return []
        if isinstance(value, dict):
            return [fault for key, entry in value.items() for fault in self.faults(f"{where}.{key}", entry)]
        if isinstance(value, (list, tuple)):
            return [fault for place, entry in enumerate(value) for fault in self.faults(f"{where}[{place}]", entry)]
        problem = self.problem(value)
        return [] if problem is None else [(where, problem)]

    @abstractmethod
    def problem(self, value: Any) -> str | None:
        """Error in the value, as `is 3, allowed is …`; None if it is valid."""


UNKNOWN = "is unknown"
_WANTED = {
    **dict.fromkeys(("dataclass_type", "dict_type"), "a mapping"),
    **dict.fromkeys(("tuple_type", "list_type"), "a list"),
    **dict.fromkeys(("float_type", "finite_number"), "float"),
    **{"int_type": "int", "string_type": "str", "bool_type": "bool"},
}
"""Error type of pydantic -> expected value in words."""


@dataclass(frozen=True)
class Range(Allowed):
    """Numbers from `low` to `high`; an open bound itself is not allowed."""

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
"""A share above 0."""
RATE_HZ = Range(1.0, 10_000.0)
"""Rates of frames, labels and filters [Hz]; no recording of a body is slower or faster."""
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
class Keys(Remark):
    """Constraints on the keys and values of a mapping."""

    keys: Allowed
    values: Allowed | None = None

    def faults(self, where: str, value: Any) -> list[tuple[str, str]]:
        problems = {key: self._problem_of_key(key) for key in value}
        return [
            *((f"{where}.{key}", problem) for key, problem in problems.items() if problem),
            *(self.values.faults(where, value) if self.values else ()),
        ]

    def _problem_of_key(self, key: Any) -> str | None:
        problem = self.keys.problem(key)
        if problem and isinstance(self.keys, OneOf):
            return f"{UNKNOWN}, there are: {', '.join(self.keys.names)}"
        return problem and f"has a key that {problem}"


def check(*faults: list[tuple[str, str]]) -> None:
    """Raise RangeError with all faults between the fields of a settings dataclass, if there are any."""
    if any(faults):
        raise RangeError(list(itertools.chain(*faults)))


def faults_of(error: ValidationError, kind: Any = None, skip: int = 0) -> list[tuple[str, str]]:
    """Faults that pydantic found in a `kind`: the key, without `skip` leading parts, and a sentence without the key."""
    found = error.errors(include_url=False)
    return [fault for each in found for fault in _faults(each, kind, each["loc"][skip:])]


def _faults(found: ErrorDetails, kind: Any, place: tuple[int | str, ...]) -> list[tuple[str, str]]:
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    inner = found.get("ctx", {}).get("error")
    if isinstance(inner, RangeError):
        return [(key + (where if where[:1] in ("", ".", "[") else f".{where}"), text) for where, text in inner.faults]
    code, value = found["type"], found["input"]
    if code == "missing" and isinstance(place[-1], int):
        short = place[-1] == len(value)  # one fault of a list, not one of each entry that lacks
        return [(key.rpartition("[")[0], f"has {len(value)} entries, expected more")] if short else []
    if code == "missing":
        return [(key, "is missing")]
    if code == "unexpected_keyword_argument":
        return [(key, f"{UNKNOWN}, there are: {', '.join(_fields(kind, place[:-1]))}")]
    if code == "too_long":
        return [(key, f"has {len(value)} entries, expected {found.get('ctx', {})['max_length']}")]
    expected = _WANTED.get(code)
    return [(key, f"is {value!r}, expected {expected}" if expected else f"is {value!r}: {found['msg']}")]


def _fields(kind: Any, place: Sequence[int | str]) -> list[str]:
    """Fields of the dataclass at a place in a type."""
    while not dataclasses.is_dataclass(kind) and typing.get_origin(kind) not in (tuple, dict):
        kind = typing.get_args(kind)[0]  # of an annotation with remarks, of `kind | None`
    if dataclasses.is_dataclass(kind):
        if not place:
            return [field.name for field in dataclasses.fields(kind) if field.init]
        return _fields(typing.get_type_hints(kind, include_extras=True)[str(place[0])], place[1:])
    return _fields(typing.get_args(kind)[1 if typing.get_origin(kind) is dict else 0], place[1:])


def increasing(settings: Any, *names: str) -> list[tuple[str, str]]:
    """Faults of fields that have to increase from one to the next."""
    faults = []
    for one, two in itertools.pairwise(names):
        low, high = getattr(settings, one), getattr(settings, two)
        if not low < high:
            faults.append((two, f"is {high:g}, allowed is more than '{one}' ({low:g})"))
    return faults
