"""Report on the reading of a log: error type, size limits, losses and clock jumps.

Also the settings of `data/hardware_logs.yaml`, and the robots by number of joints.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Int

from pipeline.errors import FileError
from pipeline.files.ranges import PART, POSITIVE, RATE_HZ
from pipeline.robot import Robot


class LogError(FileError):
    """Raised for a rejected log, with the byte offset of the problem and the number of messages read before it."""

    def __init__(self, path: Path | str, problem: str, do: str = "", offset: int = 0, recovered: int = 0):
        problem = " ".join(problem.split())
        super().__init__(path, f"{problem} (at byte {offset}, {recovered} messages read).", do)
        self.offset, self.recovered, self.reason = offset, recovered, problem


class Bounds:
    """Size limits of a file. Larger values are due to damage or malice."""

    record_bytes = 64_000_000
    """Largest record, and largest decompressed chunk. A recorder's chunks have 0.8 to 4 MB."""
    total_bytes = 20_000_000_000
    """Largest total of all decompressed chunks."""
    messages = 50_000_000
    chunks = 200_000
    """Most chunks; a recorder's chunk contains about 1 s."""
    channels = 1_000
    schema_bytes = 250_000


@dataclass(frozen=True, kw_only=True)
class Loss:
    """A position in the file where messages may be missing."""

    offset: int
    problem: str


@dataclass
class LogReport:
    """Report on one file. `messages` is the number of messages read per topic, including unused topics."""

    path: Path
    losses: list[Loss] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    """Remarks on irregularities without loss."""
    messages: dict[str, int] = field(default_factory=dict)
    checked: int = 0
    """Number of chunks with a correct checksum."""
    unchecked: int = 0
    """Number of chunks without a checksum and of message sequences outside chunks."""
    whole_checked: bool = False
    """Whether the checksum of the whole data section is correct."""
    offset: int = 0
    """Current read position [bytes]."""
    ended: bool = False
    """Whether the end of the data section was reached."""

    @property
    def total(self) -> int:
        return sum(self.messages.values())

    @property
    def integrity(self) -> str:
        """Value for `Trial.integrity`."""
        if self.unchecked and not self.whole_checked:
            return "unverified"
        return "recovered" if self.losses or not self.ended else "complete"

    def lose(self, offset: int, problem: str) -> Loss:
        """Record a loss."""
        self.losses.append(Loss(offset=offset, problem=problem))
        return self.losses[-1]

    def refuse(self, problem: str, do: str = "") -> LogError:
        """The error for rejecting the file."""
        return LogError(self.path, problem, do, self.offset, self.total)

    def sentence(self) -> str:
        """One sentence on the messages read and lost."""
        text = f"{self.total} messages read"
        if self.losses:
            first = self.losses[0]
            more = f" and {len(self.losses) - 1} more" if len(self.losses) > 1 else ""
            text += f", lost: {first.problem} at byte {first.offset}{more}"
        if self.integrity == "unverified":
            text += ", no checksums: faults in it can't be detected (record with the preset zstd_small)"
        return text + "."


MIN_STRETCH = 3
"""Least number of messages of a stretch; fewer with a deviating time have a wrong timestamp."""
LATEST_NS = 1 << 62


def stretches(
    time_ns: Int[np.ndarray, " m"], last_ns: int | None, *, back_ns: int, ahead_ns: int
) -> list[tuple[Int[np.ndarray, " k"], bool]]:
    """Split messages where the clock jumps; messages with wrong timestamps are left out.

    For each stretch: the indices in file order, and whether it follows a clock jump or a long pause. Reordering up to
    `back_ns` and pauses up to `ahead_ns` are no jumps; `last_ns` is the previous timestamp, if any.
    """
    kept = np.flatnonzero((time_ns >= 0) & (time_ns < LATEST_NS))
    times = time_ns[kept]
    if not len(times):
        return []
    steps = np.diff(times)
    breaks = np.flatnonzero((steps > ahead_ns) | (steps < -back_ns)) + 1
    groups = [group for group in np.split(np.arange(len(times)), breaks) if len(group)]
    if len(groups) > 1 or last_ns is not None:
        long = [group for group in groups if len(group) >= MIN_STRETCH]
        groups = long or [group for group in groups if _runs_on(int(times[group[0]]), last_ns, back_ns, ahead_ns)]
    found: list[tuple[np.ndarray, bool]] = []
    for group in groups:
        runs_on = _runs_on(int(times[group[0]]), last_ns, back_ns, ahead_ns)
        if runs_on and found:
            index, jump = found[-1]
            found[-1] = (np.concatenate([index, kept[group]]), jump)
        else:
            found.append((kept[group], not runs_on))
        last_ns = int(times[group].max())
    return found


def _runs_on(time_ns: int, last_ns: int | None, back_ns: int, ahead_ns: int) -> bool:
    return last_ns is None or -back_ns <= int(time_ns) - last_ns <= ahead_ns


def layouts(robots: Iterable[Robot]) -> dict[int, tuple[Robot, ...]]:
    """Number of joints -> robots. If several robots have the same number, a log must state its robot."""
    found: dict[int, tuple[Robot, ...]] = {}
    for each in robots:
        count = len(each.joint_names)
        found[count] = (*found.get(count, ()), each)
    return found


@dataclass(frozen=True, kw_only=True)
class TimeSettings:
    """Time base of trials."""

    rate_hz: Annotated[float, RATE_HZ]
    bridge_s: Annotated[float, POSITIVE]
    split_s: Annotated[float, POSITIVE]
    disorder_s: Annotated[float, POSITIVE]
    min_s: Annotated[float, POSITIVE]

    @property
    def period_ns(self) -> int:
        return round(1e9 / self.rate_hz)


@dataclass(frozen=True, kw_only=True)
class PlausibleSettings:
    """Limits of plausible values."""

    position_margin_rad: Annotated[float, POSITIVE]
    speed_factor: Annotated[float, POSITIVE]
    acceleration_m_s2: Annotated[float, POSITIVE]
    rest_gyro_rad_s: Annotated[float, POSITIVE]
    rest_joint_rad_s: Annotated[float, POSITIVE]
    rest_gravity_m_s2: tuple[float, float]
    rest_tilt_deg: Annotated[float, POSITIVE]
    frozen_s: Annotated[float, POSITIVE]
    rate_hz: tuple[float, float]
    implausible_share: Annotated[float, PART]


@dataclass(frozen=True, kw_only=True)
class LogSettings:
    """`data/hardware_logs.yaml`."""

    time: TimeSettings
    plausible: PlausibleSettings
