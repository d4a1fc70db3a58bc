"""Deviations of a virtual robot from its model."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from pipeline.actuators.synthesize import NO_LOAD_RATIO
from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope


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
    """Joint -> factor on the heating of its motor."""
    message_loss: float | None = None
    """Share of lost messages."""
    motor_loss_hz: float | None = None
    """Lost packets per motor and second."""

    def words(self) -> tuple[str, ...]:
        """Descriptions of the deviations, for the log."""
        numbers = {
            "gains": (self.gain_scale, 1.0, " times"),
            "command given to the controller": (self.command_scale, 1.0, " times"),
            "friction": (self.friction, 1.0, ""),
            "delay": (1000.0 * self.delay_s, 0.0, " ms"),
            "trunk mass": (self.root_mass_factor, 1.0, " times"),
            "message loss": (self.message_loss, None, ""),
            "motor packet loss": (self.motor_loss_hz, None, " Hz"),
        }
        return (
            *(f"{joint} gives {100.0 * share:g} % of its torque" for joint, share in self.torque_scale.items()),
            *(f"{joint} heats {factor:g} times" for joint, factor in self.hot.items()),
            *(f"{name} {value:g}{unit}" for name, (value, usual, unit) in numbers.items() if value != usual),
        )


def motor_envelope(robot: Robot) -> TorqueEnvelope:
    """The robot's torque limits, falling to 0 beyond the motors' speed limits as in the shipped torque-speed sweeps."""
    speed = np.array(robot.motor_speed_limit)
    return TorqueEnvelope(limit=np.array(robot.torque_limit), knee_speed=speed, no_load_speed=NO_LOAD_RATIO * speed)


def envelope_of(robot: Robot, deviations: Deviations, nominal: TorqueEnvelope) -> TorqueEnvelope:
    """The torque envelope with weakened motors. Raises UnknownNameError for an unknown joint."""
    return replace(nominal, limit=nominal.limit * by_joint(robot, deviations.torque_scale, 1.0))


def by_joint(robot: Robot, values: Mapping[str, float], default: float) -> Float[np.ndarray, " j"]:
    """Values by joint as an array in the robot's order. Raises UnknownNameError."""
    for name in values:
        if name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names)
    return np.array([values.get(name, default) for name in robot.joint_names])


@dataclass(frozen=True, kw_only=True)
class Outage:
    """Motors that give no torque for a while, as if they were not enabled."""

    start_s: float
    stop_s: float = np.inf
    """Time at which they respond again [s]; infinite: never."""
    joints: tuple[str, ...] = ()
    """Joints whose motors are off; empty: all."""

    def word(self) -> str:
        """The outage in words, for the log."""
        until = "the end" if self.stop_s == np.inf else f"{self.stop_s:g} s"
        return f"motors off from {self.start_s:g} s to {until} ({', '.join(self.joints) or 'all'})"


@dataclass(frozen=True, kw_only=True)
class FailingMotors(PdControl):
    """PD control with motors that are temporarily off or only damped. Call `torque` once per timestep, from 0 s on."""

    timestep_s: float
    stop_s: float = np.inf
    """Time of the operator's stop [s], after which the joints are only damped."""
    outages: tuple[tuple[Outage, Bool[np.ndarray, " j"]], ...] = ()
    """Each outage, with a mask of its joints."""
    clock: list[float] = field(default_factory=lambda: [0.0])

    def torque(self, target: np.ndarray, joint_pos: np.ndarray, joint_vel: np.ndarray) -> Float[np.ndarray, " j"]:
        """Torque of this timestep [N m]. Shape (j,)."""
        now = self.clock[0]
        self.clock[0] = now + self.timestep_s
        if now < self.stop_s:
            given = super().torque(target, joint_pos, joint_vel)
        else:
            given = self.envelope.clip(-self.kd * joint_vel, joint_vel)
        for outage, joints in self.outages:
            if outage.start_s <= now < outage.stop_s:
                given = np.where(joints, 0.0, given)
        return given


def joints_of(robot: Robot, outage: Outage) -> Bool[np.ndarray, " j"]:
    """Mask of the joints of an outage. Raises UnknownNameError."""
    if not outage.joints:
        return np.ones(len(robot.joint_names), dtype=bool)
    return by_joint(robot, dict.fromkeys(outage.joints, 1.0), 0.0) > 0.0
