"""A trained tracker: network, robot, joints and links."""

import dataclasses
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.deployment.policy import Policy, PolicyGains, load_policy
from pipeline.errors import FileError
from pipeline.files.npz import DAMAGED_NPZ, raise_fault_of_disk
from pipeline.robot import Robot
from pipeline.tracking.task import ACTION_SCALE, OBSERVATION, observation_size


@dataclass(frozen=True, kw_only=True)
class Tracker:
    """A tracking policy of one robot."""

    robot: str
    """Name of the robot that it was trained on."""
    network: Policy
    """Weights in single precision."""
    gains: PolicyGains
    controlled: tuple[str, ...]
    """Joints in the order of the action."""
    key_links: tuple[str, ...]
    """Observed links in order; the root link is the first."""

    def act(self, observation: Float[np.ndarray, " n"]) -> Float[np.ndarray, " a"]:
        """Mean action for one observation; faster than `Policy.act`, which is for batches."""
        value = (observation.astype(np.float32) - self.network.mean) / self.network.scale
        for weight, bias in self.network.layers[:-1]:
            value = weight @ value + bias
            value = np.maximum(value, 0.0) + np.expm1(np.minimum(value, 0.0))
        weight, bias = self.network.layers[-1]
        return weight @ value + bias


def load_tracker(path: Path, robot: Robot) -> Tracker:
    """Read a tracker. Raises FileError if the file is no tracker, or of another robot, joint set or network size."""
    return _checked(path, _read(path, path.stat().st_mtime_ns if path.is_file() else 0), robot)


@functools.lru_cache(maxsize=4)
def _read(path: Path, changed_ns: int) -> Tracker:
    """Read a tracker, cached by path and modification time `changed_ns`."""
    policy = load_policy(path)
    if policy.gains is None:
        raise FileError(path, "has no joint names and gains, so it is no tracker.", "Train one: pipeline.tracking.")
    try:
        with np.load(path, allow_pickle=False) as arrays:
            texts = {
                name: tuple(str(text) for text in np.atleast_1d(arrays[name]))
                for name in ("robot", "controlled", "key_links", "observation")
            }
            scale = float(arrays["action_scale"])
    except (*DAMAGED_NPZ, KeyError, TypeError) as error:
        raise_fault_of_disk(error)
        raise FileError(path, f"is no tracker ({error}).", "Train one: python -m pipeline.tracking --help.") from error
    if texts["observation"] != OBSERVATION or scale != ACTION_SCALE:
        problem = "was trained with another observation or action scale than this version's."
        raise FileError(path, problem, "Train it again.")
    mean, scale = policy.mean.astype(np.float32), policy.scale.astype(np.float32)
    single = tuple((weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in policy.layers)
    network = dataclasses.replace(policy, mean=mean, scale=scale, layers=single)
    return Tracker(
        robot=" ".join(texts["robot"]),
        network=network,
        gains=policy.gains,
        controlled=texts["controlled"],
        key_links=texts["key_links"],
    )


def _checked(path: Path, tracker: Tracker, robot: Robot) -> Tracker:
    cure = f"Train a tracker for '{robot.name}' with a GPU: start its job train_tracker in dagster dev."
    joints = robot.joint_names
    if tracker.robot != robot.name:
        raise FileError(path, f"the tracker is for another robot than '{robot.name}': '{tracker.robot}'.", cure)
    if tracker.gains.joint_names != joints:
        unknown = [name for name in tracker.gains.joint_names if name not in joints]
        differs = f"joints {', '.join(unknown)}" if unknown else "another joint set or order"
        raise FileError(path, f"the tracker is for another robot than '{robot.name}' ({differs}).", cure)
    if tracker.key_links != robot.key_links or tracker.controlled != robot.controlled:
        raise FileError(path, f"the tracker observes or moves other links or joints than '{robot.name}' has.", cure)
    for name in ("kp", "kd", "default_joint_pos"):
        given, expected = getattr(tracker.gains, name), getattr(robot, name)
        off = ~np.isclose(given, expected, rtol=1e-6, atol=1e-9)
        if off.any():
            joint = int(np.flatnonzero(off)[0])
            trained = f"the tracker was trained with {name} {given[joint]:g} at '{joints[joint]}'"
            raise FileError(path, f"{trained}, the robot has {expected[joint]:g}.", cure)
    sizes = (tracker.network.observation_size, tracker.network.action_size)
    needed = (observation_size(len(joints), len(robot.key_links), len(robot.controlled)), len(robot.controlled))
    if sizes != needed:
        problem = f"the network takes {sizes[0]} numbers and gives {sizes[1]}; the robot needs {needed[0]} and"
        raise FileError(path, f"{problem} {needed[1]}.", cure)
    return tracker
