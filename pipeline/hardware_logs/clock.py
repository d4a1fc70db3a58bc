"""Where the recorder's clock runs on and where it jumps, by the order in which messages lie in the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

MIN_STRETCH = 3
"""Messages of a stretch; fewer with a time of their own have a wrong stamp."""
LATEST_NS = 1 << 62


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Messages over which the clock runs on."""

    index: Int[np.ndarray, " k"]
    """In the file's order."""
    jump: bool
    """The clock jumped, or long nothing was received, before the first of them."""


def stretches(
    time_ns: Int[np.ndarray, " m"], last_ns: int | None, *, back_ns: int, ahead_ns: int
) -> tuple[Stretch, ...]:
    """Cut messages where the clock jumps; messages with a stamp of their own are left out.

    Args:
        time_ns: stamps in the file's order
        last_ns: the last stamp before them, None at the start
        back_ns: disorder that is no jump
        ahead_ns: silence that is no jump
    """
    kept = np.flatnonzero((time_ns >= 0) & (time_ns < LATEST_NS))
    times = time_ns[kept]
    if not len(times):
        return ()
    steps = np.diff(times)
    breaks = np.flatnonzero((steps > ahead_ns) | (steps < -back_ns)) + 1
    groups = [group for group in np.split(np.arange(len(times)), breaks) if len(group)]
    if len(groups) > 1 or last_ns is not None:
        long = [group for group in groups if len(group) >= MIN_STRETCH]
        groups = long or [group for group in groups if _runs_on(int(times[group[0]]), last_ns, back_ns, ahead_ns)]
    found: list[Stretch] = []
    for group in groups:
        runs_on = _runs_on(int(times[group[0]]), last_ns, back_ns, ahead_ns)
        if runs_on and found:
            index = np.concatenate([found[-1].index, kept[group]])
            found[-1] = Stretch(index=index, jump=found[-1].jump)
        else:
            found.append(Stretch(index=kept[group], jump=not runs_on))
        last_ns = int(times[group].max())
    return tuple(found)


def _runs_on(time_ns: int, last_ns: int | None, back_ns: int, ahead_ns: int) -> bool:
    return last_ns is None or -back_ns <= int(time_ns) - last_ns <= ahead_ns
