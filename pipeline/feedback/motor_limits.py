"""Approved torque limits of joints whose robot showed less than its calibration, put over the calibrated ones."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from pipeline.actuators import BoxLimits, JointActuator, dc_motor_line
from pipeline.feedback.change import Change


def lowered(actuators: Sequence[JointActuator], changes: Sequence[Change]) -> tuple[JointActuator, ...]:
    """The actuators with approved limits where these are lower; a limit is never raised by a log."""
    limits = {change.what: change for change in changes}
    return tuple(_lowered(each, limits[each.joint]) if each.joint in limits else each for each in actuators)


def _lowered(actuator: JointActuator, change: Change) -> JointActuator:
    if change.value >= actuator.box_effort_limit:
        return dataclasses.replace(actuator, verdict=f"{actuator.verdict}; logs show no less")
    line = {}
    if not math.isnan(actuator.dc_motor_no_load_speed):
        box = BoxLimits(box_effort_limit=change.value, box_velocity_limit=actuator.box_velocity_limit)
        line = vars(dc_motor_line(box, actuator.dc_motor_no_load_speed))
    logs = ", ".join(sorted({each.log for each in change.witnesses}))
    verdict = f"{actuator.verdict}; torque lowered to what {logs} showed"
    return dataclasses.replace(actuator, box_effort_limit=change.value, verdict=verdict, **line)
