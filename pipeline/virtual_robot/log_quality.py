"""Imperfections of a virtual robot's sensors, motors and network."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LogQuality:
    """Standard deviations of normal noise, and losses. Judgement: no log of a T1 is published."""

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
    """Relative torque noise: motor current is measured, gear losses are not."""
    torque: float = 0.3
    """[N m]"""
    odometer_scale: float = 1.0 / 1.2
    """Ratio of odometer to true distance: Booster's demo rescales the T1's odometer by 1.2."""
    odometer_drift: float = 0.005
    """Random walk of each speed over one second [m/s, rad/s]."""
    jitter_s: float = 0.0002
    """Jitter of the time of receipt [s]."""
    message_loss: float = 0.001
    """Share of lost messages."""
    motor_loss_hz: float = 0.02
    """Lost packets per motor and second."""


SOUND = LogQuality()


@dataclass(frozen=True, kw_only=True)
class HeatModel:
    """Motor temperature: heating by the square of the torque, cooling towards the ambient temperature."""

    ambient_c: float = 25.0
    start_c: float = 38.0
    rise_k: float = 150.0
    """Steady-state rise above ambient at the torque limit [K]; a third of the torque ends at 42 degC."""
    time_constant_s: float = 180.0
    heating: float = 1.0
    """Factor on the heating, for a faulty motor."""
