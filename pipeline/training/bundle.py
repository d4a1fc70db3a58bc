"""A training bundle: the robot's facts, expert frames, and the tracker with its reference clips, as plain files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.learning.robot_facts import CURE, RobotFacts, read_head, read_robot_facts
from pipeline.learning.training_error import TrainingError

SCHEMA = "booster-lab training bundle 2"
FPS = 50.0
TRACKER, REFERENCES = "tracker.npz", "references.npz"
"""Files that distillation needs; a bundle of a project without a tracker lacks them."""


@dataclass(frozen=True, kw_only=True)
class ExpertFrames:
    """T frames of C clips, one after the other."""

    frames: np.ndarray
    """(t, 79): x 3, R 4 (wxyz), q 21, p_ee 12, v 3, w 3, dq 21, dp_ee 12; see `pipeline/expert/frames.py`."""
    command: np.ndarray
    """(t, 3) forward, lateral [m/s], yaw rate [rad/s] that each frame obeys."""
    clip_start: np.ndarray
    """(c + 1,) index of each clip's first frame, and the end."""
    clip_weight: np.ndarray
    """(c,) `MotionWeight`."""


@dataclass(frozen=True, kw_only=True)
class References:
    """C reference clips of T frames in all at 50 Hz, which the tracker follows."""

    names: tuple[str, ...]
    clip_start: np.ndarray
    """(c + 1,) index of each clip's first frame, and the end."""
    root_pos_w: np.ndarray
    """(t, 3) [m]"""
    root_quat_w: np.ndarray
    """(t, 4) wxyz."""
    joint_pos: np.ndarray
    """(t, j) in the robot's order [rad]."""
    command: np.ndarray
    """(t, 3) velocity of the undisturbed rollout at that frame, averaged over a stride [m/s, m/s, rad/s]: what the
    robot does when it tracks the clip, and not what the clip asks for."""
    speed: np.ndarray
    """(c, 2) mean horizontal speed of the clip and of its rollout [m/s]."""

    def chosen(self, speed_tolerance: float) -> References:
        """The clips whose rollout's speed is within a tolerance of their own [m/s].

        Raises TrainingError where none is.
        """
        taken = np.abs(self.speed[:, 1] - self.speed[:, 0]) <= speed_tolerance
        if not taken.any():
            raise TrainingError(
                f"every rollout of the tracker differs from its clip by more than {speed_tolerance:g} m/s. Train a "
                "better tracker (job train_tracker), or raise distillation.speed_tolerance."
            )
        length = np.diff(self.clip_start)
        rows = np.repeat(taken, length)
        return References(
            names=tuple(name for name, kept in zip(self.names, taken, strict=True) if kept),
            clip_start=np.concatenate([[0], np.cumsum(length[taken])]),
            root_pos_w=self.root_pos_w[rows],
            root_quat_w=self.root_quat_w[rows],
            joint_pos=self.joint_pos[rows],
            command=self.command[rows],
            speed=self.speed[taken],
        )


@dataclass(frozen=True, kw_only=True)
class Teacher:
    """The tracker and the clips that it follows."""

    network: Mapping[str, np.ndarray]
    """Arrays of the tracker's file."""
    references: References


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """What a run is trained on."""

    folder: Path
    robot: RobotFacts
    expert: ExpertFrames
    about: dict[str, Any]
    """`bundle.json`: digests and licence."""
    digest: str
    """Of `bundle.json`, which states the digests of the other files."""
    teacher: Teacher | None = None
    """None in a bundle without a tracker."""

    @property
    def robot_folder(self) -> Path:
        """The robot as a folder like those of `robots/`, for validation."""
        return self.folder / "adapted_robot" / self.robot.name


def read_bundle(folder: Path, use_augmented: bool = True) -> Bundle:
    """The bundle in a folder; without augmented clips, only those that the recordings gave.

    Raises TrainingError where a file is missing, changed or of another schema, or no clip is left.
    """
    about, digest = read_head(folder, SCHEMA)
    robot = read_robot_facts(folder)
    return Bundle(
        folder=folder,
        robot=robot,
        expert=_expert(folder / "expert.npz", use_augmented),
        about=about,
        digest=digest,
        teacher=_teacher(folder, robot) if TRACKER in about["files"] else None,
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


def _teacher(folder: Path, robot: RobotFacts) -> Teacher:
    """Tracker and references. Raises TrainingError for a tracker of another robot."""
    with np.load(folder / TRACKER, allow_pickle=False) as arrays:
        network = {name: arrays[name] for name in arrays.files}
    names = tuple(str(name) for name in network["joint_names"])
    links = tuple(str(name) for name in network["key_links"])
    if names != robot.joint_names or links != robot.key_links:
        raise TrainingError(
            f"{folder / TRACKER}: the tracker is of '{network['robot']}' with other joints or links than "
            f"'{robot.name}' has. {CURE}"
        )
    with np.load(folder / REFERENCES, allow_pickle=False) as arrays:
        fields = ("clip_start", "root_pos_w", "root_quat_w", "joint_pos", "command", "speed")
        values = {name: arrays[name] for name in fields}
        references = References(names=tuple(str(name) for name in arrays["clip_name"]), **values)
    if not len(references.names):
        raise TrainingError(f"{folder / REFERENCES}: has no clip that the tracker follows to its end. {CURE}")
    return Teacher(network=network, references=references)
