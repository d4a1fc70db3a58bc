"""Small networks of a seed, in the form of a trained policy."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np

from pipeline.deployment import Policy, PolicyGains, deployment_task, save_policy
from pipeline.robot import Robot


def network(robot: Robot, rng: np.random.Generator, hidden: tuple[int, ...] = (32, 16)) -> Policy:
    """A network with the robot's sizes whose numbers are single precision, as a trained one's are."""
    task = deployment_task(robot)
    sizes = [task.observation_size, *hidden, len(task.policy_joints)]
    layers = tuple(
        (single(rng.normal(size=(out, into)) / np.sqrt(into)), single(0.1 * rng.normal(size=out)))
        for into, out in itertools.pairwise(sizes)
    )
    mean, scale = single(rng.normal(size=sizes[0])), single(rng.uniform(0.5, 2.0, size=sizes[0]))
    return with_robot_gains(Policy(mean=mean, scale=scale, layers=layers), robot)


def single(values: np.ndarray) -> np.ndarray:
    """Numbers rounded to single precision."""
    return values.astype(np.float32).astype(float)


def with_robot_gains(policy: Policy, robot: Robot) -> Policy:
    """A policy that came without gains, with those of the robot."""
    arrays = {name: getattr(robot, name).copy() for name in ("kp", "kd", "default_joint_pos")}
    return dataclasses.replace(policy, gains=PolicyGains(joint_names=robot.joint_names, **arrays))


def network_file(path: Path, robot: Robot, seed: int = 0) -> Path:
    """The npz of a network."""
    save_policy(path, network(robot, np.random.default_rng(seed)))
    return path
