"""Shared by tracking and AMP training: the robot in mjlab, plain MuJoCo physics, checkpoints, policy files."""
