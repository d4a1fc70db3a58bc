"""Criteria on the low-passed root link: height, tilt, speeds, acceleration, jerk."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pipeline import rotation, time_series
from pipeline.feasibility.criterion import NOTHING, Criterion, Degrees, MetresPerSecondCubed, Verdict, criterion
from pipeline.feasibility.motion import Motion, RootFilter
from pipeline.files.ranges import POSITIVE, Range, check
from pipeline.files.sourced import Unit
from pipeline.quality.retargeting import mean_jerk

GROUP = "root motion"


@dataclass(frozen=True, kw_only=True)
class RootSettings(RootFilter):
    """Limits for the root link, low-passed at `cutoff_hz`."""

    height: Annotated[tuple[float, float], Range(0.0, 3.0), Unit("of the standing height")]
    """Lowest and highest root height relative to the default root height."""
    tilt_deg: Degrees
    """Largest angle from upright [deg]."""
    speed: Annotated[float, Range(0.0, 15.0, open_low=True), Unit("m/s")]
    """Largest speed of the root [m/s]."""
    turn_speed: Annotated[float, POSITIVE, Unit("rad/s")]
    """Largest angular speed of the root [rad/s]."""
    acceleration: Annotated[float, POSITIVE, Unit("m/s^2")]
    """Largest acceleration of the root [m/s^2]."""
    jerk: MetresPerSecondCubed
    """Largest mean jerk of the root [m/s^3]."""

    def __post_init__(self) -> None:
        low, high = self.height
        check([] if low < high else [("height[1]", f"is {high:g}, allowed is more than the first ({low:g})")])


@criterion(
    Criterion(
        "root_height_min",
        GROUP,
        "root.height",
        "of the standing height",
        "lowest root height as a share of the default height",
        lower=True,
    ),
    Criterion(
        "root_height_max",
        GROUP,
        "root.height",
        "of the standing height",
        "highest root height as a share of the default height",
    ),
)
def root_height(motion: Motion, settings: RootSettings) -> tuple[Verdict, Verdict]:
    """Lowest and highest root height relative to the default root height."""
    ratio = motion.smooth_root_pos_w[:, 2] / motion.robot.default_root_height
    low, high = settings.height
    name = motion.robot.root_link
    lowest = f"frame {int(np.argmin(ratio))}: the {name} is at {ratio.min():.2f} of its standing height"
    highest = f"frame {int(np.argmax(ratio))}: the {name} is at {ratio.max():.2f} of its standing height"
    return (
        Verdict(
            code="root_height_min",
            value=float(ratio.min()),
            limit=low,
            text=lowest,
            bad=ratio < low,
        ),
        Verdict(code="root_height_max", value=float(ratio.max()), limit=high, text=highest, bad=ratio > high),
    )


@criterion(Criterion("root_tilt_deg", GROUP, "root.tilt_deg", "deg", "angle of the root from upright"))
def root_tilt(motion: Motion, settings: RootSettings) -> tuple[Verdict, ...]:
    """Angle between the root's z axis and the vertical."""
    up_w = rotation.rotate(motion.smooth_root_quat_w, np.array([0.0, 0.0, 1.0]))
    tilt_deg = np.degrees(np.arccos(np.clip(up_w[:, 2], -1.0, 1.0)))
    return (_peak("root_tilt_deg", tilt_deg, settings.tilt_deg, "is tilted by {:.0f} deg", motion),)


@criterion(
    Criterion("root_speed", GROUP, "root.speed", "m/s", "speed of the root, low-passed"),
    Criterion("root_turn_speed", GROUP, "root.turn_speed", "rad/s", "angular speed of the root, low-passed"),
    Criterion("root_acceleration", GROUP, "root.acceleration", "m/s^2", "acceleration of the root, low-passed"),
)
def root_speeds(motion: Motion, settings: RootSettings) -> tuple[Verdict, Verdict, Verdict]:
    """Speed, angular speed and acceleration: a jump of the root affects all of them."""
    fps = motion.clip.fps
    velocity = time_series.derivative(motion.smooth_root_pos_w, fps)
    speed = rotation.length(velocity)
    turning = rotation.length(rotation.angular_velocity_w(motion.smooth_root_quat_w, fps))
    acceleration = rotation.length(time_series.derivative(velocity, fps))
    return (
        _peak("root_speed", speed, settings.speed, "moves at {:.1f} m/s", motion),
        _peak("root_turn_speed", turning, settings.turn_speed, "turns at {:.1f} rad/s", motion),
        _peak("root_acceleration", acceleration, settings.acceleration, "is accelerated at {:.0f} m/s^2", motion),
    )


@criterion(
    Criterion("root_jerk", "smoothness", "root.jerk", "m/s^3", "mean jerk of the root, low-passed", cuts=NOTHING)
)
def root_jerk(motion: Motion, settings: RootSettings) -> tuple[Verdict, ...]:
    """Mean jerk of the root."""
    value = mean_jerk(motion.smooth_root_pos_w, motion.clip.fps)
    text = f"the mean jerk of the {motion.robot.root_link} is {value:.0f} m/s^3"
    return (Verdict(code="root_jerk", value=value, limit=settings.jerk, text=text),)


def _peak(code: str, values: np.ndarray, limit: float, does: str, motion: Motion) -> Verdict:
    frame = int(np.argmax(values))
    text = f"frame {frame}: the {motion.robot.root_link} {does.format(values[frame])}"
    return Verdict(code=code, value=float(values[frame]), limit=limit, text=text, bad=values > limit)
