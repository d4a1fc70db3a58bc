"""Approved ends of the ranges that training draws from, put over a preset's."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, TypeVar

from pipeline.errors import UnknownNameError
from pipeline.feedback.change import Change

T = TypeVar("T")


def widened(options: T, changes: Sequence[Change]) -> T:
    """Options with ranges (low, high) widened, never narrowed.

    A value below what the rule starts from moves the low end, one above the high end.

    Raises UnknownNameError for a range that the options don't have.
    """
    assert dataclasses.is_dataclass(options) and not isinstance(options, type)
    moved: dict[str, Any] = {}
    for change in changes:
        names = [field.name for field in dataclasses.fields(options)]
        if change.what not in names:
            raise UnknownNameError("range of training", change.what, names)
        low, high = moved.get(change.what, getattr(options, change.what))
        lower = change.value < change.before
        moved[change.what] = (min(low, change.value), high) if lower else (low, max(high, change.value))
    return dataclasses.replace(options, **moved)
