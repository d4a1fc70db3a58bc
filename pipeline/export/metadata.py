"""Task and metadata of an exported policy: joints, gains, default pose and rates."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.deployment import DeploymentTask, Policy, digest, policy_task
from pipeline.errors import FileError, PipelineError
from pipeline.files import csv_json
from pipeline.robot import Robot

CONFIG, DONE = "config.json", "done.json"
BUNDLE = "bundle"
"""Key of `config.json` with the run's data: digests of robot and database, source of the motor limits, licence."""
DATA_FACTS = ("robot_digest", "motors", "clips", "seconds", "licence")


def training_run(folder: Path, stated: Mapping[str, Any] | None) -> dict[str, Any]:
    """Facts of the run in `folder` from its config and its end, overridden by `stated`. Raises FileError."""
    facts = read_json(folder / CONFIG)
    facts.pop(BUNDLE, None)
    ended = read_json(folder / DONE) if (folder / DONE).is_file() else {}
    return {"name": folder.name, **facts, **ended, **(stated or {})}


def training_data(folder: Path) -> dict[str, Any]:
    """The facts of the expert database that the run in `folder` was trained on. Raises FileError."""
    facts = read_json(folder / CONFIG).get(BUNDLE)
    if not isinstance(facts, dict) or "database_digest" not in facts:
        raise FileError(folder / CONFIG, "names no database that the run was trained on.", "Train it again.")
    return {"digest": facts["database_digest"], **{name: facts[name] for name in DATA_FACTS if name in facts}}


def read_json(path: Path, do: str = "Name the folder that training wrote.") -> dict[str, Any]:
    """A JSON object. Raises FileError with the instruction `do`."""
    value = csv_json.read_json(path, do=do)
    if not isinstance(value, dict):
        raise FileError(path, "is not a JSON object.", do)
    return value


class ExportError(PipelineError):
    """A policy that can't be exported, with the reason and numbers."""


OBSERVATION = "gyro 3, gravity 3, command 3, q - q0, dq, last action; frames time-major, the oldest first"


def trained_task(robot: Robot, policy: Policy) -> DeploymentTask:
    """The deployment task of a robot with a policy's own gains.

    Raises ExportError for a policy without gains, PolicyJointsError if it lacks a joint of the robot.
    """
    if policy.gains is None:
        raise ExportError("the policy has no gains; export it with the gains of its training.")
    return policy_task(robot, policy)


def metadata(task: DeploymentTask, policy: Policy) -> dict[str, Any]:
    """Facts of a policy on a task as JSON values; joints, gains and pose in the robot's order, SI units.

    `digest` is that of the network's numbers and its gains (`pipeline.deployment.digest`).
    """
    names = {name: list(getattr(task, name)) for name in ("joint_names", "policy_joints")}
    arrays = {name: getattr(task, name).tolist() for name in ("kp", "kd", "default_joint_pos")}
    rates = {name: getattr(task, name) for name in ("action_scale", "history", "control_hz")}
    return {"robot": task.robot, **names, **arrays, **rates, "observation": OBSERVATION, "digest": digest(policy)}


def as_texts(facts: dict[str, Any]) -> dict[str, str]:
    """The metadata as texts, for formats that store only texts; other values become JSON."""
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in facts.items()}


def from_texts(texts: dict[str, str]) -> dict[str, Any]:
    """Inverse of `as_texts`; a text that is not JSON stays as it is."""
    plain = ("robot", "observation", "digest")
    return {name: text if name in plain else json.loads(text) for name, text in texts.items()}


SHIPPABLE = ("public-domain", "permissive", "attribution", "share-alike")
"""Licence classes (`pipeline.expert.licence`) whose policies may ship with the project."""


def shipping(manifest: dict[str, Any]) -> tuple[bool, str]:
    """Whether the manifest of the training database allows shipping, and why; not if it states no licence."""
    stated = manifest.get("licence", {})
    use, strictest = str(stated.get("allowed_use", "")), str(stated.get("strictest", "unknown"))
    if strictest in SHIPPABLE:
        return True, use
    forbidding = sorted(text for text, kind in stated.get("licences", {}).items() if kind not in SHIPPABLE)
    detail = f" ({'; '.join(forbidding)})" if forbidding else ""
    return False, f"the strictest licence of its database is {strictest}{detail}. {use}".strip()
