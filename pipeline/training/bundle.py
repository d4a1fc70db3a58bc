"""A training bundle: robot parameters, expert frames, and the tracker with its reference clips, as plain files."""

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
"""Files for distillation; absent from a bundle without a tracker."""


@dataclass(frozen=True, kw_only=True)
class ExpertFrames:
    """T frames of C concatenated clips."""

    frames: np.ndarray
    """(t, 79): x 3, R 4 (wxyz), q 21, p_ee 12, v 3, w 3, dq 21, dp_ee 12; see `pipeline/expert/frames.py`."""
    command: np.ndarray
    """(t, 3) velocity of each frame: forward, lateral [m/s], yaw rate [rad/s]."""
    clip_start: np.ndarray
    """(c + 1,) index of each clip's first frame, and the end."""
    clip_weight: np.ndarray
    """(c,) `MotionWeight`."""


@dataclass(frozen=True, kw_only=True)
class References:
    """C concatenated reference clips of T frames in total at 50 Hz, which the tracker follows."""

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
    """(t, 3) velocity of the tracker's undisturbed rollout (not of the clip) at each frame, averaged over a stride
    [m/s, m/s, rad/s]."""
    speed: np.ndarray
    """(c, 2) mean horizontal speed of the clip and of its rollout [m/s]."""

    def tracked_at_speed(self, speed_tolerance: float) -> References:
        """Select the clips whose mean rollout speed is within `speed_tolerance` [m/s] of the clip's.

        Raises TrainingError if there are none.
        """
        selected = np.abs(self.speed[:, 1] - self.speed[:, 0]) <= speed_tolerance
        if not selected.any():
            raise TrainingError(
                f"every rollout of the tracker differs from its clip by more than {speed_tolerance:g} m/s. Train a "
                "better tracker (job train_tracker), or raise distillation.speed_tolerance."
            )
        length = np.diff(self.clip_start)
        rows = np.repeat(selected, length)
        return References(
            names=tuple(name for name, kept in zip(self.names, selected, strict=True) if kept),
            clip_start=np.concatenate([[0], np.cumsum(length[selected])]),
            root_pos_w=self.root_pos_w[rows],
            root_quat_w=self.root_quat_w[rows],
            joint_pos=self.joint_pos[rows],
            command=self.command[rows],
            speed=self.speed[selected],
        )


@dataclass(frozen=True, kw_only=True)
class Teacher:
    """The tracker and its reference clips."""

    network: Mapping[str, np.ndarray]
    """Arrays of the tracker's file."""
    references: References


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """Input of a training run."""

    folder: Path
    robot: RobotFacts
    expert: ExpertFrames
    about: dict[str, Any]
    """`bundle.json`: digests and licence."""
    digest: str
    """SHA-256 of `bundle.json`, which contains the digests of the other files."""
    teacher: Teacher | None = None
    """None in a bundle without a tracker."""

    @property
    def robot_folder(self) -> Path:
        """Robot folder for validation, in the format of `robots/`."""
        return self.folder / "adapted_robot" / self.robot.name


def read_bundle(folder: Path, use_augmented: bool = True) -> Bundle:
    """Read the bundle in `folder`; without `use_augmented`, its expert has only clips from recordings.

    Raises TrainingError if a file is missing, changed or of another schema, or if no clip remains.
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
        selected = np.ones(len(start) - 1, dtype=bool) if use_augmented else ~arrays["clip_augmented"]
        if not selected.any():
            raise TrainingError(f"{path}: no clip is left without the augmented ones.")
        rows = np.repeat(selected, np.diff(start))
        return ExpertFrames(
            frames=arrays["frames"][rows],
            command=arrays["command"][rows],
            clip_start=np.concatenate([[0], np.cumsum(np.diff(start)[selected])]),
            clip_weight=arrays["clip_weight"][selected],
        )


def _teacher(folder: Path, robot: RobotFacts) -> Teacher:
    """Read tracker and references. Raises TrainingError for a tracker of another robot."""
    with np.load(folder / TRACKER, allow_pickle=False) as arrays:
        network = {name: arrays[name] for name in arrays.files}
    names = tuple(str(name) for name in network["joint_names"])
    links = tuple(str(name) for name in network["key_links"])
    if names != robot.joint_names or links != robot.key_links:
        raise TrainingError(
            f"{folder / TRACKER}: the tracker of '{network['robot']}' has other joints or links than "
            f"'{robot.name}'. {CURE}"
        )
    with np.load(folder / REFERENCES, allow_pickle=False) as arrays:
        fields = ("clip_start", "root_pos_w", "root_quat_w", "joint_pos", "command", "speed")
        values = {name: arrays[name] for name in fields}
        references = References(names=tuple(str(name) for name in arrays["clip_name"]), **values)
    if not len(references.names):
        raise TrainingError(f"{folder / REFERENCES}: has no clip that the tracker follows to its end. {CURE}")
    return Teacher(network=network, references=references)
