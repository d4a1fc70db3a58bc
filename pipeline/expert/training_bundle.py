"""Write a training bundle: plain files for a training run on a GPU host without the rest of the project.

<folder>/robot.xml     the MuJoCo model: no ground, motors, sensors or lights
<folder>/robot.json    names, orders, default pose, gains, motor limits, mirror, sites, collision shapes
<folder>/adapted_robot/<robot>/  the robot's own folder, for validation
<folder>/expert.npz    frames of the expert database; start, weight and commands of each clip
<folder>/tracker.npz   the tracker, if the project has one
<folder>/references.npz  clips that the tracker follows, with the velocity of its nominal rollouts
<folder>/bundle.json   digests of robot and database, and the database's allowed use
"""

import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation, time_series
from pipeline.actuators.adapted_robot import motors_source, read_actuators
from pipeline.clips.robot_clip import RobotClip
from pipeline.expert.frames import FPS
from pipeline.expert.index import database_version
from pipeline.expert.read import Database, DatabaseClip, read_database
from pipeline.files import atomic, digest
from pipeline.files.csv_json import json_text
from pipeline.physics import GRAVITY
from pipeline.robot import Robot, load_robot
from pipeline.robot.kinematics import mujoco_model
from pipeline.simulation.run import fall_height

SCHEMA = "booster-lab training bundle 2"
ROBOT = "adapted_robot"
"""Subfolder with the robot's folder."""
COMMAND_WINDOW_S = 1.0
"""Averaging time of the velocity that is a frame's command, about a stride [s]."""

REFERENCE_PARTS = ("root_pos_w", "root_quat_w", "joint_pos")

MIN_COMMAND = 0.12
"""Velocity on every axis below which a frame's command is to stand [m/s, rad/s]."""


@dataclass(frozen=True, kw_only=True)
class TrackedClip:
    """A reference clip and its nominal rollout at the same frames."""

    reference: RobotClip
    rollout: RobotClip


@dataclass(frozen=True, kw_only=True)
class TrackerFiles:
    """The tracker, and the clips that it follows to their end."""

    network: Path
    clips: Sequence[TrackedClip]


def write_training_bundle(
    folder: Path, database_folder: Path, robot_folder: Path, tracker: TrackerFiles | None = None
) -> dict[str, Any]:
    """Write a bundle; return the content of its `bundle.json`.

    Args:
        folder: output folder
        database_folder: the expert database
        robot_folder: the adapted robot (a folder with `actuators.csv`)
        tracker: files for distillation; None: the policy can only be trained from scratch

    Raises DatabaseError, RobotError and FileError for incomplete inputs.
    """
    database, robot = read_database(database_folder), load_robot(robot_folder)
    files = {
        "robot.xml": robot.mjcf.encode(),
        "robot.json": json_text(robot_facts(robot, robot_folder)).encode(),
        "expert.npz": expert_arrays(database),
        **{
            f"{ROBOT}/{robot.name}/{path.name}": path.read_bytes()
            for path in sorted(robot_folder.iterdir())
            if path.is_file()
        },
    }
    if tracker is not None and tracker.clips:
        files |= {"tracker.npz": tracker.network.read_bytes(), "references.npz": reference_arrays(tracker.clips)}
    about = {
        "schema": SCHEMA,
        "robot": robot.name,
        "robot_digest": robot.digest,
        "motors": motors_source(read_actuators(robot_folder)),
        "database_digest": database_version(database_folder),
        "licence": database.manifest["licence"],
        "clips": len(database.clips),
        "seconds": database.manifest["seconds"],
        "augmented_by": augmented_by(database.index["variant"]),
        "files": {name: digest.of_bytes(data) for name, data in files.items()},
    }
    for name, data in {**files, "bundle.json": json_text(about).encode()}.items():
        atomic.write_bytes(folder / name, data)
    return about


def augmented_by(variants: Iterable[str]) -> list[str]:
    """Words for the augmentations of variants (`mirror~x0.9`, `step_width0.02`)."""
    marks = {mark for variant in variants if variant != "original" for mark in variant.split("~")}
    ways = {re.sub(r"-?[0-9.]+$", "", mark).replace("_", " ") for mark in marks}
    usual = {"mirror": "mirror", "x": "time-scale"}
    return [usual[way] for way in usual if way in ways] + sorted(ways - set(usual))


def robot_facts(robot: Robot, robot_folder: Path) -> dict[str, Any]:
    """Data of a robot for the training environment that are not in its model."""
    motors = {each.joint: each for each in read_actuators(robot_folder)}
    known = [motors[name].dc_motor_no_load_speed == motors[name].dc_motor_no_load_speed for name in robot.joint_names]
    line = {"saturation_effort": "dc_motor_saturation_effort", "no_load_speed": "dc_motor_no_load_speed"}
    return {
        "robot": robot.name,
        "root_link": robot.root_link,
        "joint_names": robot.joint_names,
        "controlled": robot.controlled,
        "policy_joints": robot.policy_joints,
        "default_joint_pos": robot.default_joint_pos.tolist(),
        "default_root_height": robot.default_root_height,
        "fall_height": fall_height(robot),
        "leg_length": robot.leg_length,
        "weight": round(robot.total_mass, 3) * GRAVITY,
        "kp": robot.kp.tolist(),
        "kd": robot.kd.tolist(),
        "effort_limit": [motors[name].box_effort_limit for name in robot.joint_names],
        **{
            key: [
                getattr(motors[name], field) if ok else None for name, ok in zip(robot.joint_names, known, strict=True)
            ]
            for key, field in line.items()
        },
        "mirror_index": robot.mirror_index.tolist(),
        "mirror_sign": robot.mirror_sign.tolist(),
        "hands": robot.hands,
        "feet": robot.feet,
        "foot_links": [robot.link_names[robot.tree.site_link[robot.site(foot)]] for foot in robot.feet],
        "shapes": _shapes(robot),
        "key_links": robot.key_links,
    }


def _shapes(robot: Robot) -> dict[str, list[str]]:
    """Names of the collision shapes: of the feet, of the shanks, and of the others those with cheap collision tests."""
    model = mujoco_model(robot)
    feet = {robot.link_names[robot.tree.site_link[robot.site(foot)]] for foot in robot.feet}
    shanks = {robot.human["left_shank"], robot.human["right_shank"]}
    cheap = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE)
    shapes: dict[str, list[str]] = {"feet": [], "shanks": [], "others": []}
    for index in range(model.ngeom):
        if not model.geom_contype[index]:
            continue
        link = robot.link_names[int(model.geom_bodyid[index]) - 1]
        kind = "feet" if link in feet else "shanks" if link in shanks else "others"
        if kind != "others" or model.geom_type[index] in cheap:
            shapes[kind].append(model.geom(index).name)
    return shapes


def expert_arrays(database: Database) -> bytes:
    """The npz of a database: equal databases give equal bytes."""
    clips = database.clips
    variants = dict(zip(database.index["clip"], database.index["variant"], strict=True))
    names = [str(name) for name in database.index["clip"]]
    arrays = {
        "frames": np.asfortranarray(np.concatenate([clip.frames for clip in clips]), dtype=np.float32),
        "command": np.concatenate([frame_commands(clip) for clip in clips]).astype(np.float32),
        "clip_start": np.cumsum([0, *(len(clip.frames) for clip in clips)]),
        "clip_weight": np.array([clip.weight for clip in clips]),
        "clip_augmented": np.array([variants[name] != "original" for name in names]),
        "clip_name": np.array(names),
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # pyright: ignore[reportArgumentType]
    return stream.getvalue()


def reference_arrays(clips: Sequence[TrackedClip]) -> bytes:
    """The npz of reference clips; `command` and the second column of `speed` are measured on the rollouts."""
    references = [clip.reference for clip in clips]
    arrays = {
        "clip_name": np.array([clip.name for clip in references]),
        "clip_start": np.cumsum([0, *(clip.frame_count for clip in references)]),
        "command": np.concatenate([_commands(c.rollout.root_pos_w, c.rollout.root_quat_w) for c in clips]),
        "speed": np.array([[_mean_speed(clip.reference), _mean_speed(clip.rollout)] for clip in clips]),
        **{name: np.concatenate([getattr(clip, name) for clip in references]) for name in REFERENCE_PARTS},
    }
    single = {name: value.astype(np.float32) for name, value in arrays.items() if value.dtype == np.float64}
    stream = io.BytesIO()
    np.savez_compressed(stream, **{**arrays, **single})  # pyright: ignore[reportArgumentType]
    return stream.getvalue()


def _mean_speed(clip: RobotClip) -> float:
    """Horizontal speed of the averaged velocity, mean over a clip [m/s]."""
    command = _commands(clip.root_pos_w, clip.root_quat_w)
    return float(np.linalg.norm(command[:, :2], axis=1).mean())


def frame_commands(clip: DatabaseClip) -> Float[np.ndarray, "t 3"]:
    """Velocity command of each frame of a clip: forward, lateral [m/s], yaw rate [rad/s]."""
    return _commands(clip.frames[:, :3], clip.frames[:, 3:7])


def _commands(root_pos_w: Float[np.ndarray, "t 3"], root_quat_w: Float[np.ndarray, "t 4"]) -> Float[np.ndarray, "t 3"]:
    """Forward and lateral velocity [m/s] and yaw rate [rad/s] of each frame, averaged over a stride around it.

    Where the average is below MIN_COMMAND on every axis it is zero: the robot stands.
    """
    heading = rotation.yaw_of(root_quat_w)
    vel_w = time_series.derivative(root_pos_w, FPS)
    cos, sin = np.cos(heading), np.sin(heading)
    forward, left = vel_w[:, 0] * cos + vel_w[:, 1] * sin, -vel_w[:, 0] * sin + vel_w[:, 1] * cos
    yaw_rate = time_series.derivative(np.unwrap(heading)[:, None], FPS)[:, 0]
    width = 2 * round(COMMAND_WINDOW_S * FPS / 2) + 1
    mean = time_series.moving_mean(np.stack([forward, left, yaw_rate], axis=1), width)
    mean[(np.abs(mean) < MIN_COMMAND).all(axis=1)] = 0.0
    return mean
