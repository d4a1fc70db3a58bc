"""What a training environment must know of a robot: names, orders, default pose, gains, motor limits, collision shapes.

Read from `robot.json` and `robot.xml` of a training bundle, so that a GPU host needs nothing else of the project.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.learning.training_error import TrainingError
from pipeline.physics import GRAVITY

CURE = (
    "Write the bundle again: dagster asset materialize --select t1/amp_policy (a tracker's bundle: dagster job execute "
    "-m assets.definitions -j train_tracker; another robot's: by its name)."
)

T1_WEIGHT_N, T1_LEG_M = 31.734 * GRAVITY, 0.5516
"""Size of the robot that the figures of the paper and of the recipe are for."""


@dataclass(frozen=True, kw_only=True)
class RobotFacts:
    """J joints in hardware order; A of them, in the network's order, are the policy's."""

    name: str
    mjcf: str
    root_link: str
    joint_names: tuple[str, ...]
    controlled: tuple[str, ...]
    """The policy's joints in the order of the expert frames."""
    policy_joints: tuple[str, ...]
    default_joint_pos: np.ndarray
    default_root_height: float
    """[m]"""
    fall_height: float
    """Height of the root [m] below which the robot has fallen."""
    leg_length: float
    """[m]"""
    weight: float
    """[N]"""
    kp: np.ndarray
    kd: np.ndarray
    effort_limit: np.ndarray
    """[N m]"""
    saturation_effort: np.ndarray
    """Where the torque-speed line meets standstill [N m]; NaN where the line is not known."""
    no_load_speed: np.ndarray
    """[rad/s]; NaN where it is not known."""
    mirror_index: np.ndarray
    mirror_sign: np.ndarray
    hands: tuple[str, str]
    feet: tuple[str, str]
    """Sites at the centres of the soles."""
    foot_links: tuple[str, str]
    key_links: tuple[str, ...]
    """Links whose pose the tracking task compares; the root link is one of them. Empty in bundles without them."""
    shapes: dict[str, list[str]]
    """Collision shapes: `feet`, `shanks`, `others`."""

    @property
    def weight_ratio(self) -> float:
        """Weight over the T1's: forces that are given for the T1 are times this."""
        return self.weight / T1_WEIGHT_N

    @property
    def leg_ratio(self) -> float:
        """Leg length over the T1's: lengths that are given for the T1 are times this, speeds times its root."""
        return self.leg_length / T1_LEG_M

    def index(self, names: tuple[str, ...]) -> np.ndarray:
        """Where `names` are among the joints."""
        return np.array([self.joint_names.index(name) for name in names])


def read_head(folder: Path, schema: str) -> tuple[dict[str, Any], str]:
    """`bundle.json` of a bundle and its digest; it states the digests of the other files, which are checked.

    Raises TrainingError where a file is missing, changed or of another schema.
    """
    head = _bytes(folder / "bundle.json")
    try:
        about = json.loads(head)
    except ValueError as error:
        raise TrainingError(f"{folder}/bundle.json: is not JSON ({error}). {CURE}") from error
    found = about.get("schema") if isinstance(about, dict) else about
    if found != schema:
        raise TrainingError(f"{folder}/bundle.json: schema {found!r}; this version reads {schema!r}. {CURE}")
    if not isinstance(about.get("files"), dict):
        raise TrainingError(f"{folder}/bundle.json: states no digests of its files. {CURE}")
    for name, stated in about["files"].items():
        if hashlib.sha256(_bytes(folder / name)).hexdigest() != stated:
            raise TrainingError(f"{folder / name}: its digest is not the one in bundle.json. {CURE}")
    return about, hashlib.sha256(head).hexdigest()


def _bytes(path: Path) -> bytes:
    if not path.is_file():
        raise TrainingError(f"{path}: the file is missing. {CURE}")
    return path.read_bytes()


def read_robot_facts(folder: Path) -> RobotFacts:
    """The robot of a bundle. Raises TrainingError where `robot.json` or `robot.xml` is missing or incomplete."""
    try:
        facts = json.loads((folder / "robot.json").read_text())
        return robot_facts(facts, (folder / "robot.xml").read_text())
    except (OSError, ValueError, KeyError) as error:
        problem = f"robot.json or robot.xml of the bundle can't be read ({error})"
        raise TrainingError(f"{folder}: {problem}. {CURE}") from error


def robot_facts(facts: dict[str, Any], mjcf: str) -> RobotFacts:
    """The robot of the values of `robot.json` and the text of `robot.xml`."""
    numbers = ("default_joint_pos", "kp", "kd", "effort_limit", "saturation_effort", "no_load_speed", "mirror_sign")
    names = ("joint_names", "controlled", "policy_joints", "hands", "feet", "foot_links")
    taken: dict[str, Any] = {name: np.array(facts[name], dtype=float) for name in numbers}
    taken |= {name: tuple(facts[name]) for name in names}
    plain = ("root_link", "default_root_height", "fall_height", "leg_length", "weight", "shapes")
    taken |= {name: facts[name] for name in plain}
    key_links, mirror_index = tuple(facts.get("key_links", ())), np.array(facts["mirror_index"])
    return RobotFacts(name=facts["robot"], mjcf=mjcf, key_links=key_links, mirror_index=mirror_index, **taken)
