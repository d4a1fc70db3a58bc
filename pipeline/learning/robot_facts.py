"""Robot parameters of a training environment: names, orders, default pose, gains, motor limits, collision shapes.

Read from `robot.json` and `robot.xml` of a training bundle, so that a GPU host needs no other file of the project.
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
"""Weight and leg length of the T1, for which the values of paper and recipe are given."""


@dataclass(frozen=True, kw_only=True)
class RobotFacts:
    """Parameters of a robot with J joints in hardware order; the policy moves A of them, in the network's order."""

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
    """Stall torque of the torque-speed line (j,) [N m]; NaN if unknown."""
    no_load_speed: np.ndarray
    """No-load speed of the torque-speed line (j,) [rad/s]; NaN if unknown."""
    mirror_index: np.ndarray
    mirror_sign: np.ndarray
    hands: tuple[str, str]
    feet: tuple[str, str]
    """Sites at the centres of the soles."""
    foot_links: tuple[str, str]
    key_links: tuple[str, ...]
    """Links whose poses the tracking task compares, including the root link; empty in bundles without tracker data."""
    shapes: dict[str, list[str]]
    """Collision shapes: `feet`, `shanks`, `others`."""

    @property
    def weight_ratio(self) -> float:
        """Weight relative to the T1, a factor for forces given for the T1."""
        return self.weight / T1_WEIGHT_N

    @property
    def leg_ratio(self) -> float:
        """Leg length relative to the T1, a factor for lengths given for the T1; its square root scales speeds."""
        return self.leg_length / T1_LEG_M

    def index(self, names: tuple[str, ...]) -> np.ndarray:
        """Indices of `names` in `joint_names`."""
        return np.array([self.joint_names.index(name) for name in names])


def read_head(folder: Path, schema: str) -> tuple[dict[str, Any], str]:
    """Read `bundle.json` and its SHA-256, and check the digests of the other files that it lists.

    Raises TrainingError if a file is missing, changed or of another schema.
    """
    head = _bytes(folder / "bundle.json")
    try:
        about = json.loads(head)
    except ValueError as error:
        raise TrainingError(f"{folder}/bundle.json: is not JSON ({error}). {CURE}") from error
    actual = about.get("schema") if isinstance(about, dict) else about
    if actual != schema:
        raise TrainingError(f"{folder}/bundle.json: schema {actual!r}; this version reads {schema!r}. {CURE}")
    if not isinstance(about.get("files"), dict):
        raise TrainingError(f"{folder}/bundle.json: has no digests of its files. {CURE}")
    for name, expected in about["files"].items():
        if hashlib.sha256(_bytes(folder / name)).hexdigest() != expected:
            raise TrainingError(f"{folder / name}: its digest differs from the one in bundle.json. {CURE}")
    return about, hashlib.sha256(head).hexdigest()


def _bytes(path: Path) -> bytes:
    if not path.is_file():
        raise TrainingError(f"{path}: the file is missing. {CURE}")
    return path.read_bytes()


def read_robot_facts(folder: Path) -> RobotFacts:
    """Read the robot of a bundle. Raises TrainingError if `robot.json` or `robot.xml` is missing or incomplete."""
    try:
        facts = json.loads((folder / "robot.json").read_text())
        return robot_facts(facts, (folder / "robot.xml").read_text())
    except (OSError, ValueError, KeyError) as error:
        problem = f"robot.json or robot.xml of the bundle can't be read ({error})"
        raise TrainingError(f"{folder}: {problem}. {CURE}") from error


def robot_facts(facts: dict[str, Any], mjcf: str) -> RobotFacts:
    """Build the robot from the values of `robot.json` and the text of `robot.xml`."""
    numbers = ("default_joint_pos", "kp", "kd", "effort_limit", "saturation_effort", "no_load_speed", "mirror_sign")
    names = ("joint_names", "controlled", "policy_joints", "hands", "feet", "foot_links")
    values: dict[str, Any] = {name: np.array(facts[name], dtype=float) for name in numbers}
    values |= {name: tuple(facts[name]) for name in names}
    plain = ("root_link", "default_root_height", "fall_height", "leg_length", "weight", "shapes")
    values |= {name: facts[name] for name in plain}
    key_links, mirror_index = tuple(facts.get("key_links", ())), np.array(facts["mirror_index"])
    return RobotFacts(name=facts["robot"], mjcf=mjcf, key_links=key_links, mirror_index=mirror_index, **values)
