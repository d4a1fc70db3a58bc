"""A training bundle as it is read: the robot's facts and the expert frames."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.training.training_error import TrainingError

SCHEMA = "booster-lab training bundle 1"
FPS = 50.0


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
    shapes: dict[str, list[str]]
    """Collision shapes: `feet`, `shanks`, `others`."""

    def index(self, names: tuple[str, ...]) -> np.ndarray:
        """Where `names` are among the joints."""
        return np.array([self.joint_names.index(name) for name in names])


@dataclass(frozen=True, kw_only=True)
class ExpertFrames:
    """T frames of C clips, one after the other."""

    frames: np.ndarray
    """(t, 79): x 3, R 4 (wxyz), q 21, p_ee 12, v 3, w 3, dq 21, dp_ee 12; see `pipeline/expert/frames.py`."""
    command: np.ndarray
    """(t, 3) forward, lateral [m/s], yaw rate [rad/s] that each frame obeys."""
    clip_start: np.ndarray
    """(c + 1,) where each clip begins, and the end."""
    clip_weight: np.ndarray
    """(c,) `MotionWeight`."""

    @property
    def controlled(self) -> int:
        """Controlled joints of a frame."""
        return (self.frames.shape[1] - 37) // 2


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """What a run is trained on."""

    robot: RobotFacts
    expert: ExpertFrames
    about: dict[str, Any]
    """`bundle.json`: digests and licence."""
    digest: str
    """Of `bundle.json`, which states the digests of the other files."""


def read_bundle(folder: Path, use_augmented: bool = True) -> Bundle:
    """The bundle in a folder; without augmented clips, only those that the recordings gave.

    Raises TrainingError where a file is missing, changed or of another schema, or no clip is left.
    """
    about = json.loads(_bytes(folder / "bundle.json"))
    if about.get("schema") != SCHEMA:
        raise TrainingError(f"{folder}/bundle.json: schema {about.get('schema')!r}, this version reads {SCHEMA!r}.")
    for name, wanted in about["files"].items():
        if hashlib.sha256(_bytes(folder / name)).hexdigest() != wanted:
            raise TrainingError(
                f"{folder / name}: its digest is not the one bundle.json states. Write the bundle again."
            )
    facts = json.loads(_bytes(folder / "robot.json"))
    return Bundle(
        robot=_robot(facts, _bytes(folder / "robot.xml").decode()),
        expert=_expert(folder / "expert.npz", use_augmented),
        about=about,
        digest=hashlib.sha256(_bytes(folder / "bundle.json")).hexdigest(),
    )


def _robot(facts: dict[str, Any], mjcf: str) -> RobotFacts:
    numbers = ("default_joint_pos", "kp", "kd", "effort_limit", "saturation_effort", "no_load_speed", "mirror_sign")
    names = ("joint_names", "controlled", "policy_joints", "hands", "feet", "foot_links")
    taken: dict[str, Any] = {name: np.array(facts[name], dtype=float) for name in numbers}
    taken |= {name: tuple(facts[name]) for name in names}
    return RobotFacts(
        name=facts["robot"],
        mjcf=mjcf,
        root_link=facts["root_link"],
        default_root_height=facts["default_root_height"],
        mirror_index=np.array(facts["mirror_index"]),
        shapes=facts["shapes"],
        **taken,
    )


def _expert(path: Path, use_augmented: bool) -> ExpertFrames:
    with np.load(path, allow_pickle=False) as arrays:
        start = arrays["clip_start"]
        taken = np.ones(len(start) - 1, dtype=bool) if use_augmented else ~arrays["clip_augmented"]
        if not taken.any():
            raise TrainingError(f"{path}: no clip is left without the augmented ones.")
        rows = np.repeat(taken, np.diff(start))
        return ExpertFrames(
            frames=arrays["frames"][rows],
            command=arrays["command"][rows],
            clip_start=np.concatenate([[0], np.cumsum(np.diff(start)[taken])]),
            clip_weight=arrays["clip_weight"][taken],
        )


def _bytes(path: Path) -> bytes:
    if not path.is_file():
        raise TrainingError(f"{path}: the file is missing. A bundle is written by pipeline.expert.training_bundle.")
    return path.read_bytes()
