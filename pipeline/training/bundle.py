"""A training bundle as it is read: the robot's facts and the expert frames."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.learning.robot_facts import RobotFacts, read_robot_facts
from pipeline.learning.training_error import TrainingError

SCHEMA = "booster-lab training bundle 1"
FPS = 50.0


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
    return Bundle(
        robot=read_robot_facts(folder),
        expert=_expert(folder / "expert.npz", use_augmented),
        about=about,
        digest=hashlib.sha256(_bytes(folder / "bundle.json")).hexdigest(),
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
