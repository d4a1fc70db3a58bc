"""Task and metadata of an exported policy: joints, gains, default pose and rates."""

from __future__ import annotations

import json
from typing import Any

from pipeline.deployment import DeploymentTask, Policy, digest, policy_task
from pipeline.export.export_error import ExportError
from pipeline.robot import Robot

OBSERVATION = "gyro 3, gravity 3, command 3, q - q0, dq, last action; frames time-major, the oldest first"


def trained_task(robot: Robot, policy: Policy) -> DeploymentTask:
    """The deployment task of a robot with a policy's own gains.

    Raises ExportError for a policy without gains, UnknownNameError if it lacks a joint of the robot.
    """
    if policy.gains is None:
        raise ExportError("the policy has no gains; export it with the ones that it was trained with.")
    return policy_task(robot, policy)


def metadata(task: DeploymentTask, policy: Policy) -> dict[str, Any]:
    """Facts of a policy on a task as JSON values; joints, gains and pose in the robot's order, SI units.

    `digest` is that of the network's numbers and its gains (`pipeline.deployment.digest`).
    """
    return {
        "robot": task.robot,
        "joint_names": list(task.joint_names),
        "policy_joints": list(task.policy_joints),
        "kp": task.kp.tolist(),
        "kd": task.kd.tolist(),
        "default_joint_pos": task.default_joint_pos.tolist(),
        "action_scale": task.action_scale,
        "history": task.history,
        "control_hz": task.control_hz,
        "observation": OBSERVATION,
        "digest": digest(policy),
    }


def as_texts(facts: dict[str, Any]) -> dict[str, str]:
    """The metadata as texts, for formats that store only texts; other values become JSON."""
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in facts.items()}


def from_texts(texts: dict[str, str]) -> dict[str, Any]:
    """Inverse of `as_texts`; a text that is not JSON stays as it is."""
    return {name: _value(name, text) for name, text in texts.items()}


def _value(name: str, text: str) -> Any:
    if name in ("robot", "observation", "digest"):
        return text
    return json.loads(text)
