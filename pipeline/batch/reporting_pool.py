"""A pool of processes with a progress report on stderr, for long commands."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.batch import ClipPool

EVERY_S = 2.0
"""Shortest time between two lines [s]."""


@dataclass(frozen=True, kw_only=True)
class ReportingPool(ClipPool):
    """A `ClipPool` that prints the number of finished calls and the estimated remaining time."""

    what: str
    """Description of the calls, such as `parts of the trials`."""

    def map(self, function: Callable[..., Any], calls: Sequence[tuple], **options: Any) -> Iterator[Any]:
        """Yield results in order, with a progress line about every `EVERY_S`."""
        started = last = time.monotonic()
        print(f"{self.what}: 0 of {len(calls)}", file=sys.stderr, flush=True)
        for count, result in enumerate(super().map(function, calls, **options), 1):
            yield result
            now = time.monotonic()
            if now - last >= EVERY_S or count == len(calls):
                last = now
                left_s = (now - started) / count * (len(calls) - count)
                rest = f", about {left_s:.0f} s left" if count < len(calls) else f", {now - started:.0f} s"
                print(f"{self.what}: {count} of {len(calls)}{rest}", file=sys.stderr, flush=True)
