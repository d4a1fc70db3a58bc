"""Options from texts, as a command line or a config of an asset gives them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from pipeline.learning.training_error import TrainingError
from pipeline.training.options import Options

ANY_LENGTH = ("hidden", "discriminator_hidden")
"""Options of as many numbers as are given."""


def changed_by_texts(options: Options, texts: Mapping[str, str]) -> Options:
    """These options with some changed, each value given as text in the form of the option's value: `.5`, `true`, `1,2`.

    Raises TrainingError for a name that is none and for a text that does not look like such a value.
    """
    known = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    return options.changed(**{name: _value(name, text, known.get(name)) for name, text in texts.items()})


def texts_of(values: Mapping[str, Any]) -> list[str]:
    """Changed options as `name=value`, in the form that `changed_by_texts` reads."""
    return [f"{name}={_text(value)}" for name, value in sorted(values.items())]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(_text(each) for each in value) if isinstance(value, (list, tuple)) else str(value)


def _value(name: str, text: str, like: Any) -> Any:
    try:
        if isinstance(like, bool):
            return {"true": True, "false": False}[text.lower()]
        if isinstance(like, tuple):
            parts = text.split(",")
            if len(parts) != len(like) and name not in ANY_LENGTH:
                raise ValueError(len(parts))
            return tuple(type(like[0])(part) for part in parts)
        return type(like)(text) if like is not None else text
    except (KeyError, ValueError) as error:
        raise TrainingError(f"option '{name}' is '{text}'; it must look like '{like}'.") from error
