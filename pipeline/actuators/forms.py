"""The two forms of motor limits in simulators. Both have a "velocity limit", with different meanings.

The box (the paper; Isaac Lab's `effort_limit_sim`, `velocity_limit_sim`) holds torque and speed below the knee. The DC
motor (Isaac Lab `DCMotor`, mjlab `DcMotorActuator`) is a line from the saturation torque at rest to no torque at the
no-load speed, cut at the effort limit:

    torque <= min(effort limit, saturation (1 - speed / no-load speed))

It meets the effort limit at the knee speed when saturation = knee torque / (1 - knee speed / no-load speed). Giving it
the box's velocity limit as its own would leave no torque at the knee.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class BoxLimits:
    """The box form: limits below the knee."""

    box_effort_limit: float
    """Knee torque [N m]."""
    box_velocity_limit: float
    """Knee speed [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class DcMotorLine:
    """The DC-motor form."""

    dc_motor_effort_limit: float
    """Knee torque [N m]: `effort_limit` of mjlab and Isaac Lab."""
    dc_motor_saturation_effort: float
    """Torque of the line at rest [N m]: `saturation_effort`. The motor never reaches it."""
    dc_motor_no_load_speed: float
    """Speed without torque [rad/s]: `velocity_limit` of both."""


def dc_motor_line(box: BoxLimits, no_load_speed: float) -> DcMotorLine:
    """The line through a knee. Raises ValueError if the no-load speed is not above the knee speed."""
    if not no_load_speed > box.box_velocity_limit:
        raise ValueError(f"no-load speed {no_load_speed:g} rad/s is not above the knee's {box.box_velocity_limit:g}.")
    saturation = box.box_effort_limit / (1.0 - box.box_velocity_limit / no_load_speed)
    return DcMotorLine(
        dc_motor_effort_limit=box.box_effort_limit,
        dc_motor_saturation_effort=saturation,
        dc_motor_no_load_speed=no_load_speed,
    )
