"""What the robot readers share: which robot a file is of, and its clip from checked columns."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.quaternion_order import check_unit
from pipeline.readers.raw_motion import MIN_FRAMES, counted
from pipeline.robot import Kinematics, Robot, load_robot
from pipeline.robot.load import ROBOTS

MAX_TILT_DEG = 60.0
"""A quaternion column in the wrong order shows as a trunk that lies: the median tilt has to be below this."""

MAX_ANGLE = 2.0 * np.pi
"""No joint of a humanoid turns further [rad]; more means degrees."""

MAX_LINK_ERROR = 0.05
"""How far the links of our model may lie from the file's bodies [m], median over frames."""


@dataclass(frozen=True, kw_only=True)
class RobotMotion:
    """A robot's motion as a file tells it. T frames, J joints in the file's order."""

    format: str
    path: Path
    root_pos_w: Float[np.ndarray, "t 3"]
    """[m]"""
    root_quat_w: Float[np.ndarray, "t 4"]
    """wxyz"""
    joint_pos: Float[np.ndarray, "t j"]
    """[rad]"""
    joint_names: tuple[str, ...] | None
    """Names of the columns of `joint_pos`; None where the file has none."""
    fps: float | None
    """As the file declares [Hz]."""
    body_pos_w: Float[np.ndarray, "t b 3"] | None = None
    """World positions of bodies in any order [m], to check the joints' order with."""
    notes: tuple[Reason, ...] = ()


@functools.cache
def robots() -> tuple[Robot, ...]:
    """Every robot of the project."""
    return tuple(load_robot(folder.name) for folder in sorted(ROBOTS.iterdir()) if (folder / "robot.toml").is_file())


def to_robot_clip(motion: RobotMotion, name: str, fps: float) -> RobotClip:
    """The clip, joints in the robot's order. Raises FileError, AmbiguousFileError for joints without names."""
    path = motion.path
    if len(motion.joint_pos) < MIN_FRAMES:
        raise FileError(path, f"the file has {counted(len(motion.joint_pos))}, which is no motion.")
    robot, columns = _robot_of(motion)
    check_unit(path, motion.root_quat_w, "the root's quaternion")
    _check_upright(path, motion.root_quat_w)
    if float(np.nanmax(np.abs(motion.joint_pos), initial=0.0)) > MAX_ANGLE:
        joint = robot.joint_names[int(np.nanargmax(np.nanmax(np.abs(motion.joint_pos[:, columns]), axis=0)))]
        worst = float(np.nanmax(np.abs(motion.joint_pos)))
        problem = f"joint '{joint}' reaches {worst:.1f} rad, a joint turns {MAX_ANGLE:.2f} at most."
        raise FileError(path, problem, "Convert degrees to radians.")
    quat = rotation.normalize(motion.root_quat_w)
    valid = np.isfinite(quat).all(axis=1)
    quat[valid] = rotation.make_continuous(quat[valid])
    clip = RobotClip(
        name=name,
        fps=fps,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=motion.root_pos_w,
        root_quat_w=quat,
        joint_pos=motion.joint_pos[:, columns],
    )
    if motion.body_pos_w is not None or motion.joint_names is None:
        _check_links(motion, robot, clip)
    return clip


def _robot_of(motion: RobotMotion) -> tuple[Robot, list[int]]:
    """The robot with these joints, and where in the file each of its joints is."""
    count, names = motion.joint_pos.shape[1], motion.joint_names
    if names is None:
        fitting = [robot for robot in robots() if len(robot.joint_names) == count]
        if len(fitting) != 1:
            found = ", ".join(robot.name for robot in fitting) or "no robot"
            raise AmbiguousFileError(
                motion.path, f"{count} joints without names fit {found}.", "Add the joints' names to the file."
            )
        return fitting[0], list(range(count))
    for robot in robots():
        if set(robot.joint_names) == set(names) and len(names) == count:
            return robot, [names.index(joint) for joint in robot.joint_names]
    known = robots()[0]
    missing = ", ".join(sorted(set(known.joint_names) - set(names))) or "none"
    extra = ", ".join(sorted(set(names) - set(known.joint_names))[:12]) or "none"
    raise FileError(motion.path, f"its joints are no robot's; for '{known.name}' missing: {missing}; extra: {extra}.")


def _check_upright(path: Path, quat: Float[np.ndarray, "t 4"]) -> None:
    up = rotation.rotate(rotation.normalize(quat), np.array([0.0, 0.0, 1.0]))[:, 2]
    tilt_deg = float(np.rad2deg(np.arccos(np.clip(np.nanmedian(up), -1.0, 1.0)))) if np.isfinite(up).any() else 180.0
    if tilt_deg > MAX_TILT_DEG:
        problem = f"the trunk is tilted by {tilt_deg:.0f} degrees in the middle of its frames."
        raise FileError(path, problem, "The quaternion's order (wxyz or xyzw) or the up axis is not this format's.")


def _check_links(motion: RobotMotion, robot: Robot, clip: RobotClip) -> None:
    """Every link of our model has a body of the file where our kinematics put it; proves order and signs."""
    if motion.body_pos_w is None:
        return
    whole = [each.reshape(clip.frame_count, -1) for each in (clip.root_pos_w, clip.root_quat_w, clip.joint_pos)]
    whole.append(motion.body_pos_w.reshape(clip.frame_count, -1))
    complete = np.flatnonzero(np.isfinite(np.concatenate(whole, axis=1)).all(axis=1))
    if not len(complete):
        raise FileError(motion.path, "no frame is complete: every row holds values that are not numbers.")
    frames = np.unique(complete[np.linspace(0, len(complete) - 1, 20).astype(int)])
    poses = Kinematics(robot).forward(clip.root_pos_w[frames], clip.root_quat_w[frames], clip.joint_pos[frames])
    gaps = np.linalg.norm(poses.pos_w[:, :, None] - motion.body_pos_w[frames][:, None], axis=-1).min(axis=2)
    error = np.median(gaps, axis=0)
    if not error.max() < MAX_LINK_ERROR:
        link = robot.link_names[int(np.nanargmax(error))]
        problem = f"link '{link}' of {robot.name} would be {error.max():.2f} m from any body of the file."
        raise FileError(motion.path, problem, "The joints' order, their signs or the quaternion's order differ.")
