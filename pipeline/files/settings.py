"""Settings files: YAML that is checked against a frozen dataclass, every fault named at once.

The safe loader alone is not enough: duplicate keys, anchors and aliases are refused here, numbers are plain decimals
(`1e3` is one, `1:30`, `0x10` and `010` are none). What values are allowed the dataclass checks itself
(`pipeline.files.ranges`).
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import re
import types
import typing
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import yaml

from pipeline.errors import SettingsError
from pipeline.files.ranges import RangeError
from pipeline.files.sourced import Unit, value_of

MAX_BYTES = 1_000_000

INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)\Z")
DECIMAL = re.compile(r"[-+]?((0|[1-9][0-9]*)(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?\Z")
"""Numbers as settings have them. YAML 1.1 also takes `1:30` for 90, `0x10` for 16, `010` for 8 and `1_0` for 10; these
are texts here, which no field of a number takes."""

_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")

T = TypeVar("T")


class _StrictLoader(yaml.SafeLoader):
    """SafeLoader without aliases, without duplicate keys, and with numbers that are plain decimals alone."""

    yaml_implicit_resolvers: ClassVar = {
        first: [(tag, pattern) for tag, pattern in each if tag not in _NUMBERS]
        for first, each in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent, index):
        if self.check_event(yaml.events.AliasEvent):
            event = self.peek_event()
            raise yaml.constructor.ConstructorError(None, None, "aliases are not allowed", event.start_mark)
        event = self.peek_event()
        tag = getattr(event, "tag", None)
        if tag is not None:
            problem = f"tags such as '{tag}' are not allowed: write the plain value"
            raise yaml.constructor.ConstructorError(None, None, problem, event.start_mark)
        return super().compose_node(parent, index)

    def construct_object(self, node, deep=False):
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, AttributeError, TypeError) as error:  # of a date or number that is none
            problem = f"a value can't be read ({error})"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark) from error

    def construct_mapping(self, node, deep=False):
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, (list, dict)):
                raise yaml.constructor.ConstructorError(None, None, "a key is not a text", key_node.start_mark)
            if key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"duplicate key '{key}'", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


_StrictLoader.add_implicit_resolver("tag:yaml.org,2002:int", INTEGER, list("-+0123456789"))
_StrictLoader.add_implicit_resolver("tag:yaml.org,2002:float", DECIMAL, list("-+0123456789."))


def read_yaml(path: Path) -> Any:
    """The value in a YAML file. Raises SettingsError with the line."""
    if not path.is_file():
        raise SettingsError(path, "the file does not exist.")
    if path.stat().st_size > MAX_BYTES:
        raise SettingsError(path, f"the file is larger than {MAX_BYTES} bytes.")
    try:
        return copy.deepcopy(_parsed(path.read_text()))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or str(error)
        raise SettingsError(path, f"{' '.join(problem.split())}.", line=mark.line + 1 if mark else None) from error


@functools.lru_cache(maxsize=64)
def _parsed(text: str) -> Any:
    """The value of a text. One text is parsed once in a process: the stages of the graph share their settings files,
    and YAML is slow."""
    loader = _StrictLoader(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def read(path: Path, kind: type[T]) -> T:
    """A settings file as the frozen dataclass `kind`. Raises SettingsError that lists every fault."""
    faults: list[str] = []
    value = _build(kind, read_yaml(path), "", faults)
    if faults:
        raise SettingsError(path, "; ".join(faults) + ".")
    return value


def parse(kind: type[T], value: Any, origin: Path) -> T:
    """A plain value (from YAML, TOML or JSON) as the dataclass `kind`; faults name `origin`."""
    faults: list[str] = []
    built = _build(kind, value, "", faults)
    if faults:
        raise SettingsError(origin, "; ".join(faults) + ".")
    return built


def plain(settings: Any) -> Any:
    """A settings object as JSON types, for digests and provenance."""
    if dataclasses.is_dataclass(settings) and not isinstance(settings, type):
        return {field.name: plain(getattr(settings, field.name)) for field in dataclasses.fields(settings)}
    if isinstance(settings, dict):
        return {str(key): plain(value) for key, value in settings.items()}
    if isinstance(settings, (list, tuple)):
        return [plain(value) for value in settings]
    return settings


def _build(kind: Any, value: Any, where: str, faults: list[str]) -> Any:
    origin = typing.get_origin(kind)
    if origin is typing.Annotated:
        bare, *remarks = typing.get_args(kind)
        unit = next((remark for remark in remarks if isinstance(remark, Unit)), None)
        before, inner = len(faults), value if unit is None else value_of(value, unit, where, faults)
        return None if inner is None and len(faults) > before else _build(bare, inner, where, faults)
    if dataclasses.is_dataclass(kind):
        return _build_dataclass(kind, value, where, faults)
    if origin in (typing.Union, types.UnionType):
        options = [option for option in typing.get_args(kind) if option is not type(None)]
        return None if value is None else _build(options[0], value, where, faults)
    if origin is tuple:
        inner = typing.get_args(kind)
        if not isinstance(value, (list, tuple)):
            faults.append(f"'{where}' is {value!r}, wanted a list")
            return ()
        if inner[-1] is not Ellipsis and len(value) != len(inner):
            faults.append(f"'{where}' has {len(value)} entries, wanted {len(inner)}")
            return ()
        each = [inner[0]] * len(value) if inner[-1] is Ellipsis else list(inner)
        pairs = enumerate(zip(each, value, strict=True))
        return tuple(_build(entry_kind, entry, f"{where}[{index}]", faults) for index, (entry_kind, entry) in pairs)
    if origin is dict:
        if not isinstance(value, dict):
            faults.append(f"'{where}' is {value!r}, wanted a mapping")
            return {}
        inner = typing.get_args(kind)[1]
        return {str(key): _build(inner, entry, f"{where}.{key}", faults) for key, entry in value.items()}
    return _build_scalar(kind, value, where, faults)


def _build_scalar(kind: Any, value: Any, where: str, faults: list[str]) -> Any:
    if kind is Any:
        return value
    if kind is float and isinstance(value, (int, float, str)) and not isinstance(value, bool):
        plain = not isinstance(value, str) or DECIMAL.match(value)
        number = float(value) if plain else float("nan")
        if number == number and abs(number) != float("inf"):
            return number
    elif isinstance(value, kind) and (kind is bool or not isinstance(value, bool)):
        return value
    faults.append(f"'{where}' is {value!r}, wanted {kind.__name__}")
    return None


def _build_dataclass(kind: Any, value: Any, where: str, faults: list[str]) -> Any:
    if not isinstance(value, dict):
        faults.append(f"'{where or 'the file'}' is {value!r}, wanted a mapping")
        return None
    hints = typing.get_type_hints(kind, include_extras=True)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    prefix = f"{where}." if where else ""
    for unknown in sorted(set(map(str, value)) - set(fields)):
        faults.append(f"unknown key '{prefix}{unknown}', there are: {', '.join(fields)}")
    built, before = {}, len(faults)
    for name, field in fields.items():
        if name in value:
            built[name] = _build(hints[name], value[name], f"{prefix}{name}", faults)
        elif _is_required(field):
            faults.append(f"'{prefix}{name}' is missing")
    try:
        if len(faults) == before:
            return kind(**built)
        _check_what_is_there(kind, built)
    except RangeError as error:
        faults += [f"'{prefix}{key}' {problem}" for key, problem in error.faults]
    return None


def _check_what_is_there(kind: Any, built: dict[str, Any]) -> None:
    """Ranges of an object that can't be made as some of its values are missing or refused. Raises RangeError."""
    if hasattr(kind, "__post_init__"):
        incomplete = object.__new__(kind)
        vars(incomplete).update(built)
        incomplete.__post_init__()


def _is_required(field: dataclasses.Field) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
