"""Simulation: MuJoCo rollouts, motor torque limits, self-collisions, sensors, terrain."""
