"""The settings of `data/hardware_logs.yaml`."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.files.ranges import PART, POSITIVE, RATE_HZ, check


@dataclass(frozen=True, kw_only=True)
class TimeSettings:
    """The time base of trials."""

    rate_hz: float
    bridge_s: float
    split_s: float
    disorder_s: float
    min_s: float

    def __post_init__(self) -> None:
        lengths = {name: POSITIVE for name in ("bridge_s", "split_s", "disorder_s", "min_s")}
        check(self, rate_hz=RATE_HZ, **lengths)

    @property
    def period_ns(self) -> int:
        return round(1e9 / self.rate_hz)


@dataclass(frozen=True, kw_only=True)
class PlausibleSettings:
    """What a robot can say of itself."""

    position_margin_rad: float
    speed_factor: float
    acceleration_m_s2: float
    rest_gyro_rad_s: float
    rest_joint_rad_s: float
    rest_gravity_m_s2: tuple[float, float]
    rest_tilt_deg: float
    frozen_s: float
    rate_hz: tuple[float, float]
    implausible_share: float

    def __post_init__(self) -> None:
        names = ("position_margin_rad", "speed_factor", "acceleration_m_s2", "rest_gyro_rad_s", "rest_joint_rad_s")
        check(
            self,
            implausible_share=PART,
            rest_tilt_deg=POSITIVE,
            frozen_s=POSITIVE,
            **{name: POSITIVE for name in names},
        )


@dataclass(frozen=True, kw_only=True)
class LogSettings:
    """The whole file."""

    time: TimeSettings
    plausible: PlausibleSettings
