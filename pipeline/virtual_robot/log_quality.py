"""How well a virtual robot's sensors, motors and network do: what a log has that a simulation does not."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LogQuality:
    """Noise is normal, given by its standard deviation. The numbers are judgement: nobody published a log of a T1."""

    attitude: float = 0.003
    """[rad]"""
    gyro: float = 0.01
    """[rad/s]"""
    acceleration: float = 0.15
    """[m/s^2]"""
    joint_pos: float = 0.0005
    """[rad]"""
    joint_vel: float = 0.03
    """[rad/s]"""
    torque_share: float = 0.02
    """Of the torque: a motor's current is measured, its gear's loss is not."""
    torque: float = 0.3
    """[N m]"""
    odometer_scale: float = 1.0 / 1.2
    """What the odometer says over what was walked: Booster's own demo rescales the T1's by 1.2."""
    odometer_drift: float = 0.005
    """Of each speed, a random walk's step in a second [m/s, rad/s]."""
    jitter_s: float = 0.0002
    """Of the time of receipt [s]."""
    message_loss: float = 0.001
    """Share of messages that are not received."""
    motor_loss_hz: float = 0.02
    """Packets that a motor loses a second."""


SOUND = LogQuality()


@dataclass(frozen=True, kw_only=True)
class HeatModel:
    """A motor warms with the square of its torque and cools towards the room."""

    ambient_c: float = 25.0
    start_c: float = 38.0
    rise_k: float = 150.0
    """Above the room in the steady state at the torque limit. Standing at a third of it then ends at 42 degC."""
    time_constant_s: float = 180.0
    heating: float = 1.0
    """Factor on the heat, for a motor with a fault."""
