"""Real to sim: torque-speed measurements of the motors, their knees and armatures, and the robot adapted to them."""

from pipeline.actuators.adapted_robot import (
    NO_MEASUREMENTS,
    JointActuator,
    adapt,
    motors_source,
    read_actuators,
    torque_envelope,
    write_adapted_robot,
)
from pipeline.actuators.calibrate import Calibration, Knee, calibrate
from pipeline.actuators.folder import CalibratedFolder, calibrate_folder
from pipeline.actuators.forms import BoxLimits, DcMotorLine, dc_motor_line
from pipeline.actuators.knee_fit import Interval, KneeFit, fit_knee
from pipeline.actuators.log_envelope import JointLog, log_envelope
from pipeline.actuators.motor_table import Motor, read_motors
from pipeline.actuators.settings import ActuatorSettings
from pipeline.actuators.standing import StandingPose, StandingResult, read_standing_pose, stand

__all__ = [
    "NO_MEASUREMENTS",
    "ActuatorSettings",
    "BoxLimits",
    "CalibratedFolder",
    "Calibration",
    "DcMotorLine",
    "Interval",
    "JointActuator",
    "JointLog",
    "Knee",
    "KneeFit",
    "Motor",
    "StandingPose",
    "StandingResult",
    "adapt",
    "calibrate",
    "calibrate_folder",
    "dc_motor_line",
    "fit_knee",
    "log_envelope",
    "motors_source",
    "read_actuators",
    "read_motors",
    "read_standing_pose",
    "stand",
    "torque_envelope",
    "write_adapted_robot",
]
