"""Settings files: YAML validated by pydantic as a frozen dataclass, with all faults in one error.

Stricter than the safe loader: duplicate keys, anchors and aliases are rejected, and numbers must be plain decimals
(`1e3` is allowed; `1:30`, `0x10` and `010` are not). Annotations state the allowed values (`pipeline.files.ranges`) and
the unit (`pipeline.files.sourced`).
"""

import copy
import dataclasses
import functools
import json
import math
import re
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import yaml
from pydantic import ConfigDict, ValidationError, create_model

from pipeline.errors import SettingsError
from pipeline.files.ranges import UNKNOWN, faults_of

MAX_BYTES = 1_000_000

INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)\Z")
DECIMAL = re.compile(r"[-+]?((0|[1-9][0-9]*)(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?\Z")
"""Notation of numbers in settings. YAML 1.1 also reads `1:30` as 90, `0x10` as 16, `010` as 8 and `1_0` as 10; these
are strings here, which number fields reject."""

_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")

T = TypeVar("T")


class _StrictLoader(yaml.SafeLoader):
    """SafeLoader without aliases, without duplicate keys, and with plain decimals as the only numbers."""

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
        except (ValueError, LookupError, AttributeError, TypeError) as error:  # an invalid date or number
            problem = f"a value can't be read ({error})"
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark) from error

    def construct_mapping(self, node, deep=False):
        keys = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, (list, dict)):
                raise yaml.constructor.ConstructorError(None, None, "a key is not a text", key_node.start_mark)
            if key in keys:
                raise yaml.constructor.ConstructorError(None, None, f"duplicate key '{key}'", key_node.start_mark)
            keys.add(key)
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
    """The value of a text. Cached, since the stages of the graph share their settings files, and YAML is slow."""
    loader = _StrictLoader(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def read(path: Path, kind: type[T]) -> T:
    """A settings file as the frozen dataclass `kind`. Raises SettingsError that lists every fault."""
    return parse(kind, read_yaml(path), path)


def parse(kind: type[T], value: Any, origin: Path, do: str = "") -> T:
    """A plain value (from YAML, TOML or JSON) as the dataclass `kind`.

    Raises SettingsError with `origin`, every fault and the remedy `do`.
    """
    try:
        return _model(kind).model_validate_json(json.dumps({"file": _json(value)})).file
    except ValidationError as error:
        found = sorted(faults_of(error, kind, skip=1), key=lambda fault: not fault[1].startswith(UNKNOWN))
        faults = "; ".join(_sentence(*fault) for fault in found)
    except RecursionError:
        faults = "it is nested too deeply"
    raise SettingsError(origin, f"{faults}.", do)


def plain(settings: Any) -> Any:
    """A settings object as JSON types, for digests and provenance."""
    if dataclasses.is_dataclass(settings) and not isinstance(settings, type):
        return {field.name: plain(getattr(settings, field.name)) for field in dataclasses.fields(settings)}
    if isinstance(settings, dict):
        return {str(key): plain(value) for key, value in settings.items()}
    if isinstance(settings, (list, tuple)):
        return [plain(value) for value in settings]
    return settings


@functools.cache
def _model(kind: type) -> Any:
    """A model with the field `file`. Strict: no conversion between strings, numbers and booleans."""
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    return create_model("Settings", __config__=config, file=(kind, ...))


def _json(value: Any) -> Any:
    """The value as JSON types: keys, dates and numbers that are not finite become strings."""
    if isinstance(value, dict):
        return {str(key): _json(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json(entry) for entry in value]
    plain = value is None or isinstance(value, (str, int)) or (isinstance(value, float) and math.isfinite(value))
    return value if plain else str(value)


def _sentence(key: str, problem: str) -> str:
    key = key.removeprefix(".")
    if problem.startswith(UNKNOWN):
        return f"unknown key '{key}'{problem.removeprefix(UNKNOWN)}"
    return f"'{key or 'the file'}' {problem}"
