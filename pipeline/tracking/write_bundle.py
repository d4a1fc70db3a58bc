"""Write a tracking bundle of reference motions and an adapted robot."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.files import atomic, digest
from pipeline.files.csv_json import json_text
from pipeline.robot import Robot
from pipeline.tracking.bundle import SCHEMA
from pipeline.tracking.task import CONTROL_HZ


def write_tracking_bundle(
    folder: Path, clips: Iterable[RobotClip], robot: Robot, facts: dict[str, Any], licences: Iterable[str]
) -> dict[str, Any]:
    """Write the bundle; return the content of its `bundle.json`.

    Args:
        folder: output folder
        clips: reference motions at 50 Hz, in the order they are stored
        robot: the adapted robot
        facts: `robot.json`, as `pipeline.expert.training_bundle.robot_facts` gives it
        licences: licences of the clips

    Raises ClipError for a clip of another rate or robot.
    """
    motions = motion_arrays(clips, robot)
    files = {"robot.xml": robot.mjcf.encode(), "robot.json": json_text(facts).encode(), "motions.npz": _npz(motions)}
    about = {
        "schema": SCHEMA,
        "robot": robot.name,
        "robot_digest": robot.digest,
        "clips": len(motions["clip_name"]),
        "seconds": len(motions["joint_pos"]) / CONTROL_HZ,
        "licences": sorted(set(licences)),
        "files": {name: digest.of_bytes(data) for name, data in files.items()},
    }
    for name, data in {**files, "bundle.json": json_text(about).encode()}.items():
        atomic.write_bytes(folder / name, data)
    return about


def motion_arrays(clips: Iterable[RobotClip], robot: Robot) -> dict[str, np.ndarray]:
    """Concatenate clips, in single precision."""
    taken = list(clips)
    for clip in taken:
        if clip.fps != CONTROL_HZ:
            raise ClipError(clip.name, "rate", f"has {clip.fps:g} Hz; a tracker works at {CONTROL_HZ:g} Hz")
        if clip.joint_names != robot.joint_names:
            raise ClipError(clip.name, "joints", f"its joints are not those of '{robot.name}', or in another order")
    return {
        "clip_name": np.array([clip.name for clip in taken]),
        "clip_start": np.cumsum([0, *(clip.frame_count for clip in taken)]),
        **{
            name: np.concatenate([getattr(clip, name) for clip in taken]).astype(np.float32)
            for name in ("root_pos_w", "root_quat_w", "joint_pos")
        },
    }


def _npz(arrays: dict[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # pyright: ignore[reportArgumentType]
    return stream.getvalue()
