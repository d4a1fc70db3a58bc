"""In what a virtual robot differs from its model, and what is done to it."""

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
    """Nominal where nothing is said."""

    torque_scale: Mapping[str, float] = field(default_factory=dict)
    """Joint -> share of its torque limit that its motor still gives."""
    gain_scale: float = 1.0
    """Of kp and kd that the motors follow, against those that are sent."""
    command_scale: float = 1.0
    """Share of the command that reaches the controller."""
    friction: float = 1.0
    delay_s: float = 0.0
    """From targets to motors [s]."""
    root_mass_factor: float = 1.0
    """Of the trunk."""
    hot: Mapping[str, float] = field(default_factory=dict)
    """Joint -> factor on the heat of its motor."""
    message_loss: float | None = None
    """Share of messages that are not received."""
    motor_loss_hz: float | None = None
    """Packets that a motor loses a second."""

    def words(self) -> tuple[str, ...]:
        """What differs, as words for the log."""
        said = [f"{joint} gives {100.0 * share:g} % of its torque" for joint, share in self.torque_scale.items()]
        said += [f"{joint} heats {factor:g} times" for joint, factor in self.hot.items()]
        numbers = {
            "gains": (self.gain_scale, 1.0, "times"),
            "command told to the controller": (self.command_scale, 1.0, "times"),
            "friction": (self.friction, 1.0, ""),
            "delay": (1000.0 * self.delay_s, 0.0, "ms"),
            "trunk mass": (self.root_mass_factor, 1.0, "times"),
            "message loss": (self.message_loss, None, ""),
            "motor packet loss": (self.motor_loss_hz, None, "Hz"),
        }
        said += [f"{name} {value:g} {unit}".strip() for name, (value, usual, unit) in numbers.items() if value != usual]
        return tuple(said)


NO_LOAD_RATIO = 1.25
"""No-load speed over knee speed, as in the shipped torque-speed sweeps."""


def motor_envelope(robot: Robot) -> TorqueEnvelope:
    """The robot's torque limits, falling to 0 beyond the motors' speed limits: joints can't race."""
    speed = np.array(robot.motor_speed_limit)
    return TorqueEnvelope(limit=np.array(robot.torque_limit), knee_speed=speed, no_load_speed=NO_LOAD_RATIO * speed)


def envelope_of(robot: Robot, deviations: Deviations, nominal: TorqueEnvelope) -> TorqueEnvelope:
    """The motors' limits with the weak ones weakened. Raises UnknownNameError for a joint that the robot lacks."""
    scale = by_joint(robot, deviations.torque_scale, 1.0)
    return TorqueEnvelope(
        limit=nominal.limit * scale, knee_speed=nominal.knee_speed, no_load_speed=nominal.no_load_speed
    )


def by_joint(robot: Robot, values: Mapping[str, float], otherwise: float) -> Float[np.ndarray, " j"]:
    """Values of joints in the robot's order. Raises UnknownNameError."""
    for name in values:
        if name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names)
    return np.array([values.get(name, otherwise) for name in robot.joint_names])
