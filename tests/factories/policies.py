"""Small policies with known numbers."""

from __future__ import annotations

import itertools

import numpy as np

from pipeline.deployment import DeploymentTask, Policy, PolicyGains


def linear_policy(weight: np.ndarray, bias: np.ndarray | None = None) -> Policy:
    """One layer without normalisation: action = weight @ observation + bias."""
    actions, observations = weight.shape
    bias = np.zeros(actions) if bias is None else bias
    return Policy(mean=np.zeros(observations), scale=np.ones(observations), layers=((weight, bias),))


def still_policy(task: DeploymentTask, **others) -> Policy:
    """Always the action 0: the robot is held in its default pose."""
    shape = (len(task.policy_joints), task.observation_size)
    return Policy(
        mean=np.zeros(shape[1]), scale=np.ones(shape[1]), layers=((np.zeros(shape), np.zeros(shape[0])),), **others
    )


def random_policy(task: DeploymentTask, rng: np.random.Generator, hidden: int = 8, gains: bool = False) -> Policy:
    """Two layers of random numbers."""
    sizes = [task.observation_size, hidden, len(task.policy_joints)]
    layers = tuple((rng.normal(size=(b, a)), rng.normal(size=b)) for a, b in itertools.pairwise(sizes))
    kept = PolicyGains(joint_names=task.joint_names, kp=task.kp, kd=task.kd, default_joint_pos=task.default_joint_pos)
    return Policy(
        mean=rng.normal(size=sizes[0]),
        scale=rng.uniform(0.5, 2.0, sizes[0]),
        layers=layers,
        gains=kept if gains else None,
    )
