"""Deviations of a virtual robot from its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope


@dataclass(frozen=True, kw_only=True)
class Deviations:
    """Deviations from the nominal robot; the defaults are nominal."""

    torque_scale: Mapping[str, float] = field(default_factory=dict)
    """Joint -> remaining share of its torque limit."""
    gain_scale: float = 1.0
    """Ratio of the effective to the commanded kp and kd."""
    command_scale: float = 1.0
    """Share of the command that reaches the controller."""
    friction: float = 1.0
    delay_s: float = 0.0
    """Delay of the joint targets [s]."""
    root_mass_factor: float = 1.0
    """Factor on the trunk's mass."""
    hot: Mapping[str, float] = field(default_factory=dict)
    """Joint -> factor on its motor's heating."""
    message_loss: float | None = None
    """Share of lost messages."""
    motor_loss_hz: float | None = None
    """Lost packets per motor and second."""

    def words(self) -> tuple[str, ...]:
        """Descriptions of the deviations, for the log."""
        texts = [f"{joint} gives {100.0 * share:g} % of its torque" for joint, share in self.torque_scale.items()]
        texts += [f"{joint} heats {factor:g} times" for joint, factor in self.hot.items()]
        numbers = {
            "gains": (self.gain_scale, 1.0, "times"),
            "command given to the controller": (self.command_scale, 1.0, "times"),
            "friction": (self.friction, 1.0, ""),
            "delay": (1000.0 * self.delay_s, 0.0, "ms"),
            "trunk mass": (self.root_mass_factor, 1.0, "times"),
            "message loss": (self.message_loss, None, ""),
            "motor packet loss": (self.motor_loss_hz, None, "Hz"),
        }
        texts += [
            f"{name} {value:g} {unit}".strip() for name, (value, usual, unit) in numbers.items() if value != usual
        ]
        return tuple(texts)


NO_LOAD_RATIO = 1.25
"""No-load speed over knee speed, as in the shipped torque-speed sweeps."""


def motor_envelope(robot: Robot) -> TorqueEnvelope:
    """The robot's torque limits, falling to 0 beyond the motors' speed limits, which bounds joint speeds."""
    speed = np.array(robot.motor_speed_limit)
    return TorqueEnvelope(limit=np.array(robot.torque_limit), knee_speed=speed, no_load_speed=NO_LOAD_RATIO * speed)


def envelope_of(robot: Robot, deviations: Deviations, nominal: TorqueEnvelope) -> TorqueEnvelope:
    """The torque envelope with weakened motors. Raises UnknownNameError for an unknown joint."""
    scale = by_joint(robot, deviations.torque_scale, 1.0)
    return TorqueEnvelope(
        limit=nominal.limit * scale, knee_speed=nominal.knee_speed, no_load_speed=nominal.no_load_speed
    )


def by_joint(robot: Robot, values: Mapping[str, float], otherwise: float) -> Float[np.ndarray, " j"]:
    """Values by joint as an array in the robot's order. Raises UnknownNameError."""
    for name in values:
        if name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names)
    return np.array([values.get(name, otherwise) for name in robot.joint_names])
