"""What happened while a log was read: its one error type, its bounds, what was lost and where, and clock jumps.

Settings of `data/hardware_logs.yaml`, and which robot a log is of, by the number of its joints.
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
    """A log that is refused, with the byte that the problem was found at and the messages that were read until then."""

    def __init__(self, path: Path | str, problem: str, do: str = "", offset: int = 0, recovered: int = 0):
        problem = " ".join(problem.split())
        super().__init__(path, f"{problem} (at byte {offset}, {recovered} messages read).", do)
        self.offset, self.recovered, self.reason = offset, recovered, problem


class Bounds:
    """How much of a file is believed. What is beyond is damage or malice."""

    record_bytes = 64_000_000
    """Of a record, and of a chunk after inflation. A recorder's chunks have 0.8 to 4 MB."""
    total_bytes = 20_000_000_000
    """Of all chunks after inflation."""
    messages = 50_000_000
    chunks = 200_000
    """A recorder's chunk is a second or so."""
    channels = 1_000
    schema_bytes = 250_000


@dataclass(frozen=True, kw_only=True)
class Loss:
    """A place where messages may be missing: what was read before and after is not neighbouring."""

    offset: int
    problem: str


@dataclass
class LogReport:
    """Of one file. `messages` counts what was read of each topic, foreign ones as well."""

    path: Path
    losses: list[Loss] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    """What was noticed that loses nothing."""
    messages: dict[str, int] = field(default_factory=dict)
    checked: int = 0
    """Chunks whose checksum held."""
    unchecked: int = 0
    """Chunks without a checksum, or stretches of messages outside chunks."""
    whole_checked: bool = False
    """The checksum of the whole data section held."""
    offset: int = 0
    """Where reading is."""
    ended: bool = False
    """The data section's end was reached."""

    @property
    def total(self) -> int:
        return sum(self.messages.values())

    @property
    def integrity(self) -> str:
        """As `Trial.integrity`."""
        if self.unchecked and not self.whole_checked:
            return "unverified"
        return "recovered" if self.losses or not self.ended else "complete"

    def lose(self, offset: int, problem: str) -> Loss:
        """Note a loss."""
        self.losses.append(Loss(offset=offset, problem=problem))
        return self.losses[-1]

    def refuse(self, problem: str, do: str = "") -> LogError:
        """The error that refuses the file."""
        return LogError(self.path, problem, do, self.offset, self.total)

    def sentence(self) -> str:
        """One sentence on what was read and lost."""
        text = f"{self.total} messages read"
        if self.losses:
            first = self.losses[0]
            more = f" and {len(self.losses) - 1} more" if len(self.losses) > 1 else ""
            text += f", lost: {first.problem} at byte {first.offset}{more}"
        if self.integrity == "unverified":
            text += ", no checksums: faults in it can't be detected (record with the preset zstd_small)"
        return text + "."


MIN_STRETCH = 3
"""Messages of a stretch; fewer with a time of their own have a wrong stamp."""
LATEST_NS = 1 << 62


def stretches(
    time_ns: Int[np.ndarray, " m"], last_ns: int | None, *, back_ns: int, ahead_ns: int
) -> list[tuple[Int[np.ndarray, " k"], bool]]:
    """Cut messages where the clock jumps; messages with a stamp of their own are left out.

    Of each stretch the indices in the file's order, and whether the clock jumped, or long nothing was received, before.
    Disorder up to `back_ns` and silence up to `ahead_ns` are no jumps; `last_ns` is the last stamp before, if any.
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
    """Robots by number of joints. Where several robots have as many, a log must state its robot."""
    found: dict[int, tuple[Robot, ...]] = {}
    for each in robots:
        count = len(each.joint_names)
        found[count] = (*found.get(count, ()), each)
    return found


@dataclass(frozen=True, kw_only=True)
class TimeSettings:
    """The time base of trials."""

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
    """Plausible values of a robot."""

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
    """The whole file."""

    time: TimeSettings
    plausible: PlausibleSettings
