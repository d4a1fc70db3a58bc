"""Robot trajectories as NumPy archives: mjlab and whole-body tracking, and MuJoCo `qpos` (LocoMuJoCo).

`joint_pos` (t, j) with `body_pos_w`, `body_quat_w` (the root link's, or the first body's); or with the
root in seven columns before the joints. `qpos` (t, 7 + j): position, quaternion wxyz, joints.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.npz_file import NpzHeader, open_npz
from pipeline.readers.robot_motion import RobotMotion, robots

RATES_HZ = (24, 25, 30, 50, 60, 90, 100, 120, 125, 200, 240, 250, 300, 400, 500, 600, 1000, 2000)
"""Rates that a derived one is taken for when it is within 2 %."""

MIN_CORRELATION = 0.98
"""Of differences of position with the stored velocity; below it a rate is not derived."""


def is_robot(header: NpzHeader) -> bool:
    """An archive with a robot's joints."""
    return header.has("qpos") or header.has("joint_pos")


def read_robot_npz(path: Path) -> RobotMotion:
    """A robot's motion. Raises FileError."""
    header = open_npz(path)
    return _read_qpos(header) if header.has("qpos") else _read_joint_pos(header)


def _read_qpos(header: NpzHeader) -> RobotMotion:
    qpos = header.numbers("qpos", None, None)
    names = _names(header)
    if names is not None and len(names) == qpos.shape[1] - 6:
        names = names[1:]  # the free joint comes first
    return RobotMotion(
        format="robot_qpos",
        path=header.path,
        root_pos_w=qpos[:, :3],
        root_quat_w=qpos[:, 3:7],
        joint_pos=qpos[:, 7:],
        joint_names=names,
        fps=_declared_fps(header) or _derived_fps(header, qpos),
        body_pos_w=_bodies(header, "xpos", len(qpos)),
    )


def _read_joint_pos(header: NpzHeader) -> RobotMotion:
    joint_pos, names = header.numbers("joint_pos", None, None), _names(header)
    counts = {len(robot.joint_names) for robot in robots()} if names is None else {len(names)}
    bodies = _bodies(header, "body_pos_w", len(joint_pos))
    if joint_pos.shape[1] - 7 in counts:
        root_pos, root_quat, joint_pos = joint_pos[:, :3], joint_pos[:, 3:7], joint_pos[:, 7:]
    elif bodies is not None:
        root = _root_index(header)
        root_pos = bodies[:, root]
        root_quat = header.numbers("body_quat_w", len(joint_pos), bodies.shape[1], 4)[:, root]
    else:
        raise FileError(header.path, "there is no root: neither body_pos_w nor seven columns before the joints.")
    if names is None and bodies is None:
        problem = "joint_pos has neither joint_names nor body_pos_w, so the joints' order can't be told."
        raise AmbiguousFileError(header.path, problem, "Add joint_names to the archive.")
    return RobotMotion(
        format="robot_npz",
        path=header.path,
        root_pos_w=root_pos,
        root_quat_w=root_quat,
        joint_pos=joint_pos,
        joint_names=names,
        fps=_declared_fps(header),
        body_pos_w=bodies,
    )


def _names(header: NpzHeader) -> tuple[str, ...] | None:
    return header.texts("joint_names") if header.has("joint_names") else None


def _root_index(header: NpzHeader) -> int:
    """Index of the root link among the bodies; the first where they have no names."""
    if not header.has("body_names"):
        return 0
    names = header.texts("body_names")
    for robot in robots():
        if robot.root_link in names:
            return names.index(robot.root_link)
    raise FileError(header.path, f"no body is a robot's root link; there are: {', '.join(names[:12])}.")


def _bodies(header: NpzHeader, key: str, frames: int) -> Float[np.ndarray, "t b 3"] | None:
    """World positions of all bodies, where the archive has them."""
    if len(header.shapes.get(key, ())) != 3:
        return None
    return header.numbers(key, frames, None, 3)


def _declared_fps(header: NpzHeader) -> float | None:
    for name in ("fps", "frequency"):
        if header.has(name):
            return header.number(name)
    return None


def _derived_fps(header: NpzHeader, qpos: np.ndarray) -> float | None:
    """Rate [Hz] at which differences of the root's position are its stored velocity; None when they do not agree.

    Least squares of `qvel` on central differences of `qpos`, taken for the usual rate within 2 %.
    """
    if not header.has("qvel") or len(qpos) < 10:
        return None
    velocity = header.numbers("qvel", len(qpos), qpos.shape[1] - 1)[1:-1, :3]
    step = 0.5 * (qpos[2:, :3] - qpos[:-2, :3])
    power = float(np.sum(step * step))
    if not power > 0.0 or not np.isfinite(velocity).all():
        return None
    correlation = float(np.sum(step * velocity) / np.sqrt(power * np.sum(velocity * velocity)))
    fps = float(np.sum(step * velocity)) / power
    usual = min(RATES_HZ, key=lambda rate: abs(rate - fps))
    return float(usual) if correlation > MIN_CORRELATION and abs(usual - fps) < 0.02 * usual else None
