"""Approved torque limits of joints whose robot showed less than its calibration, put over the calibrated ones."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from pipeline.actuators import BoxLimits, JointActuator, dc_motor_line
from pipeline.feedback.change import Change, ChangeError

ROUNDED_N_M = 1e-3
"""Proposed limits are rounded to this."""


def check_limits(actuators: Sequence[JointActuator], changes: Sequence[Change], lowest: float) -> None:
    """Raises ChangeError for limits of joints that the robot lacks, or further down than its calibration allows.

    What a file says that a limit was before is nothing to go by: any hand can write it.

    Args:
        lowest: of the calibrated limit, the rule's
    """
    calibrated = {each.joint: each.box_effort_limit for each in actuators}
    faults = []
    for each in changes:
        limit = calibrated.get(each.what)
        if limit is None:
            faults.append(f"'{each.what}' is no joint of {each.robot}; there are: {', '.join(calibrated)}")
        elif each.value < lowest * limit - ROUNDED_N_M:
            least = f"{lowest:g} of the {limit:g} N m that it is calibrated to"
            faults.append(f"'{each.what}' is {each.value:g} N m; allowed is no less than {least}")
    if faults:
        raise ChangeError(
            f"data/feedback/approved.yaml, 'motors': {'; '.join(faults)}. Approve 'motors' of the current proposal "
            "again (job approve_feedback), or take it back (job take_back_feedback, or delete the entry)."
        )


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
