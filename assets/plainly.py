"""Errors that are one sentence stay one: a PipelineError becomes a Failure with that sentence, no traceback of ours.

So does a TrainingError, which is none because training runs on hosts that have nothing else of the pipeline.
"""

import functools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import dagster as dg

from pipeline.errors import PipelineError
from pipeline.learning.training_error import TrainingError


@contextmanager
def told_plainly() -> Iterator[None]:
    """Turn a PipelineError or TrainingError into a Failure that says its sentence and is not tried again."""
    try:
        yield
    except (PipelineError, TrainingError) as error:
        raise dg.Failure(str(error), allow_retries=False) from None


def plainly(function: Callable[..., Any]) -> Callable[..., Any]:
    """`told_plainly` around the body of an asset."""

    @functools.wraps(function)
    def wrapped(*arguments: Any, **named: Any) -> Any:
        with told_plainly():
            return function(*arguments, **named)

    return wrapped
