"""Read a tracking bundle: plain files with the robot's data and the reference motions, for a GPU host.

<folder>/robot.xml, robot.json   the robot, as in a training bundle
<folder>/motions.npz             reference motions at 50 Hz, one after the other
<folder>/bundle.json             digests of robot, motions and files, and the clips' licences
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.learning.robot_facts import RobotFacts, read_head, read_robot_facts
from pipeline.learning.training_error import TrainingError

SCHEMA = "booster-lab tracking bundle 1"
CONFIG = "config.json"
"""Settings of a run, with the digest of the bundle that it trains on."""


@dataclass(frozen=True, kw_only=True)
class Motions:
    """c concatenated clips with t frames in total, at 50 Hz."""

    names: tuple[str, ...]
    clip_start: np.ndarray
    """Index of each clip's first frame, and the total frame count (c + 1,)."""
    root_pos_w: np.ndarray
    """Root position (t, 3) [m]."""
    root_quat_w: np.ndarray
    """Root orientation, wxyz (t, 4)."""
    joint_pos: np.ndarray
    """Joint angles in the robot's order (t, j) [rad]."""


@dataclass(frozen=True, kw_only=True)
class TrackingBundle:
    """Robot and reference motions for the training of a tracker."""

    robot: RobotFacts
    motions: Motions
    about: dict[str, Any]
    """Content of `bundle.json`."""
    digest: str
    """Digest of `bundle.json`, which contains the digests of the other files."""


def read_tracking_bundle(folder: Path) -> TrackingBundle:
    """Read the bundle in a folder. Raises TrainingError if a file is missing, changed or of another schema."""
    about, digest = read_head(folder, SCHEMA)
    robot = read_robot_facts(folder)
    if not robot.key_links or robot.key_links[0] != robot.root_link:
        raise TrainingError(f"{folder}/robot.json: 'key_links' must begin with the root link '{robot.root_link}'.")
    return TrackingBundle(robot=robot, motions=_motions(folder / "motions.npz", robot), about=about, digest=digest)


def check_trained_on(bundle: TrackingBundle, run: Path) -> None:
    """Check the bundle of a run. Raises TrainingError if the run trained on another bundle or does not state it."""
    path = run / CONFIG
    try:
        trained_on = json.loads(path.read_text())["bundle_digest"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TrainingError(f"{path}: does not state the bundle of the run ({error}). Train again.") from error
    if trained_on != bundle.digest:
        raise TrainingError(f"{run}: is a run on another bundle. Give that bundle, or another folder.")


def _motions(path: Path, robot: RobotFacts) -> Motions:
    with np.load(path, allow_pickle=False) as arrays:
        motions = Motions(
            names=tuple(str(name) for name in arrays["clip_name"]),
            clip_start=arrays["clip_start"],
            **{name: arrays[name].astype(float) for name in ("root_pos_w", "root_quat_w", "joint_pos")},
        )
    joints = motions.joint_pos.shape[1]
    if joints != len(robot.joint_names):
        do = "Write the bundle again for this robot."
        raise TrainingError(f"{path}: has {joints} joints, the robot {len(robot.joint_names)}. {do}")
    if len(motions.names) == 0:
        raise TrainingError(f"{path}: has no clip to track.")
    return motions
