"""Constants of physics that several packages use."""

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2], the value of the robot models."""

PHYSICS_S = 0.005
"""Physics step of training and of rollouts [s]."""
