"""A small training bundle: the nominal T1 as its own adapted robot, and two clips."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.actuators.adapted_robot import adapt, write_adapted_robot
from pipeline.actuators.settings import ActuatorSettings
from pipeline.expert.training_bundle import TrackedClip, TrackerFiles, write_training_bundle
from pipeline.expert.write import ExpertEntry, write_database
from pipeline.files import settings
from pipeline.robot import Robot
from tests.factories.robot_clips import standing, wandering
from tests.factories.tracked_motion import waving
from tests.factories.tracking_bundle import tracker_file


def small_bundle(folder: Path, root: Path, robot: Robot, tracker: str = "") -> Path:
    """A bundle of a standing clip and of a wandering one that counts as augmented.

    `tracker`: also a tracker with a standing and a waving clip; `passive`: its targets are the clip's joints;
    `shipped`: the one that ships.
    """
    actuators = adapt(robot, [], settings.read(root / "data" / "actuators.yaml", ActuatorSettings))
    write_adapted_robot(folder / "adapted" / robot.name, root / "robots" / robot.name, actuators)
    entries = [
        ExpertEntry(clip=clip, weight=weight, skill="stand", licence="CC0-1.0", numbers={"variant": variant}, stages={})
        for clip, weight, variant in (
            (standing(robot), 1.0, "original"),
            (wandering(robot, seconds=3.0), 3.0, "mirror"),
        )
    ]
    write_database(folder / "database", entries, robot, stages={})
    files = None
    if tracker:
        clips = [standing(robot, seconds=4.0, name="test/still"), waving(robot, seconds=6.0)]
        shipped = root / "robots" / robot.name / "policies" / "tracker" / "tracker.npz"
        network = shipped if tracker == "shipped" else tracker_file(folder / "tracker.npz", robot)
        files = TrackerFiles(network=network, clips=[TrackedClip(reference=clip, rollout=clip) for clip in clips])
    write_training_bundle(folder / "bundle", folder / "database", folder / "adapted" / robot.name, files)
    return folder / "bundle"


def identity_frames(count: int, columns: int) -> np.ndarray:
    """Frames whose every number tells its frame and column, so that a shuffled one shows."""
    return np.arange(count)[:, None] * 100.0 + np.arange(columns)[None]
