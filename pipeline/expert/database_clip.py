"""Read a clip JSON of the database as a robot clip."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import rotation
from pipeline.clips.codec import faults_of
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import FileError
from pipeline.files.csv_json import read_json
from pipeline.robot import Robot

FACTS = ("Skill", "MotionWeight", "LoopMode", "Licence")
"""Keys of the file that are shown to the user."""
MAX_FPS = 1_000.0
"""Highest accepted frame rate [Hz]."""


def read_database_clip(path: Path, robot: Robot) -> tuple[RobotClip, dict[str, Any]]:
    """Read the clip and its facts (`FACTS`). Joints that are not in the database have their default position.

    Columns are found by name. Raises FileError if the file is not a database clip of `robot`.
    """
    content = read_json(path, "a clip of an expert database")
    try:
        columns = [column["name"] for column in content["Columns"]]
        frames = np.array(content["Frames"], dtype=float)
        fps, name, made_for = 1.0 / float(content["FrameDuration"]), content["Clip"], content["Robot"]
    except (ValueError, KeyError, TypeError, ZeroDivisionError) as error:
        raise FileError(path, f"not a clip of an expert database ({type(error).__name__}: {error}).") from error
    if not isinstance(name, str) or not 0.0 < fps <= MAX_FPS:
        raise FileError(
            path, f"its name is {name!r}, its rate {fps:g} Hz; wanted are a text and at most {MAX_FPS:g} Hz."
        )
    if made_for != robot.name:
        raise FileError(path, f"it is for the robot '{made_for}', not for '{robot.name}'.", f"Add --robot {made_for}.")
    if frames.ndim != 2 or frames.shape[1] != len(columns) or not len(frames):
        raise FileError(path, f"its frames have the shape {frames.shape}, expected (frames, {len(columns)}).")
    joints = np.tile(robot.default_joint_pos, (len(frames), 1))
    for index, joint in enumerate(robot.joint_names):
        if f"{joint}_pos" in columns:
            joints[:, index] = frames[:, columns.index(f"{joint}_pos")]
    wanted = [f"root_pos_{axis}" for axis in "xyz"] + [f"root_quat_{part}" for part in "wxyz"]
    missing = [column for column in wanted if column not in columns]
    if missing:
        raise FileError(path, f"the column '{missing[0]}' is missing.")
    root = frames[:, [columns.index(column) for column in wanted]]
    clip = robot.clip(name, fps, root[:, :3], root[:, 3:], joints)
    faults = faults_of(clip)
    if faults:
        raise FileError(path, f"{faults[0]}.", "Materialize expert_db again.")
    clip = dataclasses.replace(clip, root_quat_w=rotation.normalize(clip.root_quat_w))
    return clip, {key: content[key] for key in FACTS if key in content}
