"""Infer the order of a root's quaternion, wxyz or xyzw, if the file does not state it.

In the wrong order a heading becomes a roll, so that the trunk is horizontal at most headings. If it is upright with
both orders (headings near 0 and 180 degrees), the soles decide: in stance they are level and do not slide.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import AmbiguousFileError
from pipeline.robot import Kinematics, Robot

ORDERS = ("wxyz", "xyzw")

MAX_TILT_DEG = 60.0
"""Largest tilt of an upright trunk, median over the frames [deg]."""

MOST_FRAMES = 1500
"""Most frames that are checked."""

SURE = 2.0
"""Least ratio of the worse order's score to the better one's for a decision."""

LEVEL_DEG, SLOW = 3.0, 0.05
"""Tilt [deg] and speed [m/s] up to which a sole counts as level and at rest."""


class Soles(NamedTuple):
    """Tilt and speed of the lower sole with one order, medians over the frames."""

    tilt_deg: float
    """Tilt of the lower sole [deg]."""
    speed: float
    """Horizontal speed of each frame's lower sole [m/s]."""

    @property
    def score(self) -> float:
        """Score of the order: 1 for a sole in stance, larger otherwise."""
        return max(1.0, self.tilt_deg / LEVEL_DEG) * max(1.0, self.speed / SLOW)


def trunk_tilt_deg(quat: Float[np.ndarray, "t 4"]) -> float:
    """Median angle of the root's z axis to the vertical [deg]; 180 without a valid frame."""
    up = rotation.rotate(rotation.normalize(quat), np.array([0.0, 0.0, 1.0]))[:, 2]
    if not np.isfinite(up).any():
        return 180.0
    return float(np.rad2deg(np.arccos(np.clip(np.nanmedian(up), -1.0, 1.0))))


def in_order(columns: Float[np.ndarray, "t 4"], order: str) -> Float[np.ndarray, "t 4"]:
    """Quaternions wxyz from four columns in an order."""
    return columns if order == "wxyz" else np.roll(columns, 1, axis=1)


def inferred_order(
    path: Path,
    usual: str,
    root_quat: Float[np.ndarray, "t 4"],
    root_pos_w: Float[np.ndarray, "t 3"],
    joint_pos: Float[np.ndarray, "t j"],
    robot: Robot,
    fps: float,
) -> str:
    """`wxyz` or `xyzw`; the usual order of the format if both give the same motion or neither is upright.

    `joint_pos` is in the robot's order. Raises AmbiguousFileError if both are upright and the soles do not decide.
    """
    quats = {order: in_order(root_quat, order) for order in ORDERS}
    upright = [order for order in ORDERS if trunk_tilt_deg(quats[order]) <= MAX_TILT_DEG]
    if len(upright) != 2:
        return upright[0] if upright else usual
    soles = {order: _soles(quats[order], root_pos_w, joint_pos, robot, fps) for order in ORDERS}
    other = ORDERS[1 - ORDERS.index(usual)]
    better, worse = sorted(ORDERS, key=lambda order: (soles[order].score, order != usual))
    still = max(each.speed for each in soles.values()) <= SLOW
    if still and soles[worse].tilt_deg - soles[better].tilt_deg < LEVEL_DEG:
        return usual  # no motion and equal soles: both orders differ only in heading
    if soles[worse].score < SURE * soles[better].score:
        problem = (
            f"the order of the root's quaternion can't be inferred: as {usual} the standing sole is tilted by "
            f"{soles[usual].tilt_deg:.0f} degrees and slides at {soles[usual].speed:.2f} m/s, as {other} by "
            f"{soles[other].tilt_deg:.0f} degrees and at {soles[other].speed:.2f} m/s."
        )
        raise AmbiguousFileError(path, problem, "State `quaternion: wxyz` or `xyzw` for it in data/sources.yaml.")
    return better


def _soles(
    quat: Float[np.ndarray, "t 4"],
    root_pos_w: Float[np.ndarray, "t 3"],
    joint_pos: Float[np.ndarray, "t j"],
    robot: Robot,
    fps: float,
) -> Soles:
    """Tilt and speed of the lower sole over consecutive frames."""
    whole = np.isfinite(np.concatenate([quat, root_pos_w, joint_pos], axis=1)).all(axis=1)
    frames = np.flatnonzero(whole)[:MOST_FRAMES]
    if len(frames) < 3:
        return Soles(tilt_deg=0.0, speed=0.0)
    kinematics = Kinematics(robot)
    poses = kinematics.forward(root_pos_w[frames], rotation.normalize(quat[frames]), joint_pos[frames])
    names = [name for side in robot.sole_corners for name in side]
    corners = kinematics.site_pos_w(poses, names).reshape(len(frames), 2, 4, 3)
    middle = corners.mean(axis=2)
    lower = middle[:-1, :, 2].argmin(axis=1)
    rows = np.arange(len(frames) - 1)
    together = np.diff(frames) == 1
    speed = np.linalg.norm(np.diff(middle, axis=0)[rows, lower, :2], axis=1) * fps
    sole = corners[rows, lower]
    normal = rotation.normalize(np.cross(sole[:, 2] - sole[:, 0], sole[:, 3] - sole[:, 1]))
    tilt_deg = np.rad2deg(np.arccos(np.clip(np.abs(normal[:, 2]), 0.0, 1.0)))
    speed = speed[together] if together.any() else np.zeros(1)
    return Soles(tilt_deg=float(np.median(tilt_deg)), speed=float(np.median(speed)))
