"""Array shapes and types are checked at every call whose outcome is not known from an earlier one.

jaxtyping's check of a call takes longer than most functions of a simulation step. What comes of it depends on the
classes of arguments and result, on the shapes and number types of arrays, and on the items of containers. A call
without containers that is in all this like one that passed is therefore not checked again.
"""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable, Collection
from types import FunctionType
from typing import Any

import jaxtyping
import numpy as np
from jaxtyping import _decorator

MOST_KINDS = 500
"""Kinds of calls that are remembered of a function; further ones are checked each time."""
LONGEST_NAME = 100
"""Longer texts are not kept: they are no names."""

_jaxtyped = _decorator.jaxtyped
_checks: list[Callable[[], Any]] = []
"""What makes the checks of each function of a module."""


class _HasItemsError(Exception):
    """A value whose check depends on more than its class and shape."""


def check_each_kind_of_call_once() -> None:
    """Modules that are imported from now on have their calls checked that way; before the first one is imported."""
    _decorator.jaxtyped = jaxtyping.jaxtyped = _jaxtyped_once


def make_checks() -> None:
    """Make the checks of all functions now, so that processes that are forked need not make them one by one."""
    for make in _checks:
        make()


def _jaxtyped_once(fn: Any = None, *, typechecker: Any) -> Any:
    """jaxtyping's decorator; of classes and descriptors it decorates the functions with this one."""
    if fn is None:
        return functools.partial(_jaxtyped_once, typechecker=typechecker)
    if hasattr(fn, "checked_once"):
        return fn
    if not isinstance(fn, FunctionType) or typechecker is None or hasattr(fn, "__no_type_check__"):
        return _jaxtyped(fn, typechecker=typechecker)
    return _checked_once(fn, typechecker)


def _checked_once(function: Callable[..., Any], typechecker: Any) -> Callable[..., Any]:
    known: dict[Any, set[Any]] = {}
    """Kind of the arguments -> kinds of results that passed with them."""
    given = threading.local()

    def result_of(*args: Any, **kwargs: Any) -> Any:
        return given.result.pop() if getattr(given, "result", None) else function(*args, **kwargs)

    @functools.cache
    def checks() -> Callable[..., Any]:
        """Made for the first call: that takes longer than an import. Names in annotations are looked up in globals."""
        own = FunctionType(result_of.__code__, function.__globals__, closure=result_of.__closure__)
        return _jaxtyped(functools.update_wrapper(own, function), typechecker=typechecker)

    if "<locals>" not in function.__qualname__:
        _checks.append(checks)

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        try:
            kind = _kind(args), *kwargs, _kind(tuple(kwargs.values()))
            results = known.get(kind)
        except _HasItemsError:
            return checks()(*args, **kwargs)
        result = checks()(*args, **kwargs) if results is None else function(*args, **kwargs)
        try:
            result_kind = _kind(result)
        except _HasItemsError:
            result_kind = None
        if results is None:
            if len(known) < MOST_KINDS and result_kind is not None:
                known[kind] = {result_kind}
        elif result_kind is None or result_kind not in results:
            given.result = [result]
            checks()(*args, **kwargs)
            if result_kind is not None:
                results.add(result_kind)
        return result

    called.checked_once = True
    return called


def _kind(value: Any) -> Any:
    """What the check of a value depends on. Raises _HasItemsError where that is more than class and shape."""
    kind = type(value)
    if kind is np.ndarray:
        return value.dtype, value.shape
    if kind is str:
        return value if len(value) <= LONGEST_NAME else kind  # it may have to be one of several names
    if kind is tuple:
        return tuple([_kind(each) for each in value])
    if issubclass(kind, Collection) and kind is not bytes:
        torch = sys.modules.get("torch")
        if torch is not None and isinstance(value, torch.Tensor):
            return kind, value.dtype, tuple(value.shape)
        raise _HasItemsError
    if issubclass(kind, type):
        return value
    return kind
