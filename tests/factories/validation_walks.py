"""Rollouts of known figures, cells and measurements of known numbers."""

from __future__ import annotations

import numpy as np

from pipeline import rotation
from pipeline.robot import Robot
from pipeline.simulation.record import Rollout
from pipeline.validation.cells import TRACKING, Cell
from pipeline.validation.figures import Measured, Numbers
from pipeline.validation.trial import CommandProfile, Trial, VelocityCommand


def gliding_rollout(
    robot: Robot,
    velocity: tuple[float, float, float],
    seconds: float = 4.0,
    torque: float = 0.0,
    joint_speed: float = 0.0,
    fell_s: float | None = None,
) -> Rollout:
    """The default pose sliding over the ground with its feet down, forward and left [m/s], turning [rad/s]."""
    step_s, joints = 0.002, len(robot.joint_names)
    count = round(seconds / step_s)
    times_s = step_s * np.arange(count)
    yaw = velocity[2] * times_s
    heading = rotation.about_z(yaw)
    along = rotation.rotate(heading, np.array([velocity[0], velocity[1], 0.0]))
    place = np.cumsum(along, axis=0) * step_s + np.array([0.0, 0.0, robot.default_root_height])
    qvel = np.concatenate(
        [along, np.tile([0.0, 0.0, velocity[2]], (count, 1)), np.full((count, joints), joint_speed)], axis=1
    )
    wrench = np.zeros((count, 2, 6))
    wrench[:, :, 2] = 0.5 * robot.total_mass * 9.81
    return Rollout(
        robot=robot,
        timestep_s=step_s,
        qpos=np.concatenate([place, heading, np.tile(robot.default_joint_pos, (count, 1))], axis=1),
        qvel=qvel,
        torque=np.full((count, joints), torque),
        foot_wrench_w=wrench,
        command=np.tile(velocity, (count // 10, 1)),
        target=np.tile(robot.default_joint_pos, (count // 10, 1)),
        fell_s=fell_s,
    )


def cell(name: str, count: int = 2, figures: tuple[str, ...] = TRACKING, forward: float = 1.0) -> Cell:
    """A cell of `count` alike trials at a forward speed."""
    trials = tuple(
        Trial(
            seed=seed, command=CommandProfile(commands=(VelocityCommand(forward=forward),)), seconds=10.0, measure_s=4.0
        )
        for seed in range(1, count + 1)
    )
    return Cell(name=name, group="commands", figures=figures, trials=trials)


def measured(one: Cell, *trials: Numbers) -> Measured:
    """Numbers of a cell; those not given are good ones."""
    good: Numbers = {"fell": 0.0, "speed_error": 0.1, "yaw_rate_error": 0.02}
    good |= {"power": 100.0, "slip": 0.02, "saturation": 1.0, "drift": 5.0, "steps": 12.0}
    filled = tuple(given if given.get("fell") else good | given for given in trials)
    return Measured(cell=one, trials=filled)
