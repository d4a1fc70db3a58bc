"""Settings of `data/hardware_logs.yaml`, and which robot a log is of, by the number of its joints."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

from pipeline.files.ranges import PART, POSITIVE, RATE_HZ
from pipeline.robot import Robot


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
