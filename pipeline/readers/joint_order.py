"""What robot files leave open: the order of joints without names, and of the root's quaternion (wxyz or xyzw).

Joints are in the robot's own order, or breadth first as Isaac Lab writes them. Where an archive holds positions of
bodies they prove it: every link has to be where our kinematics puts it.

With the quaternion in the wrong order a heading becomes a roll: at most headings the trunk is horizontal. Where both
orders leave it upright (near 0 and 180 degrees) the soles decide: those that stand are level and do not slide.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.robot import Kinematics, Robot

MAX_LINK_ERROR = 0.05
"""How far the links of our model may lie from the file's bodies [m], median over frames."""

FRAMES = 20
"""Frames that are compared, evenly over the motion."""


def breadth_first(robot: Robot) -> list[int]:
    """Where in a breadth-first order each joint of the robot is, in the robot's order."""
    tree = robot.tree
    depth = np.zeros(len(tree.link_names), dtype=int)
    for link in range(1, len(depth)):
        depth[link] = depth[tree.parent[link]] + 1
    links = sorted(range(1, len(depth)), key=lambda link: (depth[link], link))
    order = [int(tree.joint[link]) for link in links]
    return [order.index(joint) for joint in range(len(order))]


def link_errors(
    robot: Robot,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
    body_pos_w: Float[np.ndarray, "t b 3"],
) -> Float[np.ndarray, " l"] | None:
    """Distance of each of our links to the nearest body of the file [m], median over frames.

    None where no frame is complete.
    """
    count = len(root_pos_w)
    arrays = (root_pos_w, root_quat_w, joint_pos, body_pos_w.reshape(count, -1))
    complete = np.flatnonzero(np.isfinite(np.concatenate(arrays, axis=1)).all(axis=1))
    if not len(complete):
        return None
    frames = np.unique(complete[np.linspace(0, len(complete) - 1, FRAMES).astype(int)])
    poses = Kinematics(robot).forward(root_pos_w[frames], root_quat_w[frames], joint_pos[frames])
    gaps = np.linalg.norm(poses.pos_w[:, :, None] - body_pos_w[frames][:, None], axis=-1).min(axis=2)
    return np.median(gaps, axis=0)


ORDERS = ("wxyz", "xyzw")

MAX_TILT_DEG = 60.0
"""A trunk tilted by more than this is not upright: median over the frames [deg]."""

MOST_FRAMES = 1500
"""Frames that are checked, at most."""

SURE = 2.0
"""The worse order's score is at least this many times the better one's."""

LEVEL_DEG, SLOW = 3.0, 0.05
"""Tilt [deg] and speed [m/s] of a standing sole up to which it counts as level and still."""


@dataclass(frozen=True, kw_only=True)
class Soles:
    """How a robot stands with one order, medians over the frames."""

    tilt_deg: float
    """Of the lower sole [deg]."""
    speed: float
    """Of the lower sole along the ground, each frame's [m/s]."""

    @property
    def score(self) -> float:
        """1 for a sole that stands; the larger the less it does."""
        return max(1.0, self.tilt_deg / LEVEL_DEG) * max(1.0, self.speed / SLOW)


def trunk_tilt_deg(quat: Float[np.ndarray, "t 4"]) -> float:
    """Median angle of the root's z axis to the vertical [deg]; 180 where no frame is known."""
    up = rotation.rotate(rotation.normalize(quat), np.array([0.0, 0.0, 1.0]))[:, 2]
    if not np.isfinite(up).any():
        return 180.0
    return float(np.rad2deg(np.arccos(np.clip(np.nanmedian(up), -1.0, 1.0))))


def in_order(columns: Float[np.ndarray, "t 4"], order: str) -> Float[np.ndarray, "t 4"]:
    """Quaternions wxyz from four columns in an order."""
    return columns if order == "wxyz" else np.roll(columns, 1, axis=1)


def inferred_order(
    path: Path,
    columns: Float[np.ndarray, "t 4"],
    root_pos_w: Float[np.ndarray, "t 3"],
    joint_pos: Float[np.ndarray, "t j"],
    robot: Robot,
    usual: str,
    fps: float | None,
) -> str:
    """`wxyz` or `xyzw`; the `usual` one of the format where both give the same motion or neither stands upright.

    `joint_pos` is in the robot's order. Raises AmbiguousFileError where both are upright and the soles do not decide.
    """
    upright = [order for order in ORDERS if trunk_tilt_deg(in_order(columns, order)) <= MAX_TILT_DEG]
    if len(upright) != 2:
        return upright[0] if upright else usual
    soles = {order: _soles(in_order(columns, order), root_pos_w, joint_pos, robot, fps or 50.0) for order in ORDERS}
    other = ORDERS[1 - ORDERS.index(usual)]
    better, worse = sorted(ORDERS, key=lambda order: (soles[order].score, order != usual))
    still = max(each.speed for each in soles.values()) <= SLOW
    if still and soles[worse].tilt_deg - soles[better].tilt_deg < LEVEL_DEG:
        return usual  # nothing moves and both stand alike: the same motion under two headings
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
    """How the lower sole stands over frames in a row."""
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


NORM_MIN, NORM_MAX = 0.99, 1.01
"""Norms beyond these are no rounding: the numbers are not unit quaternions."""


def check_unit(path: Path, quat: np.ndarray, what: str, first: int = 0) -> None:
    """Check that quaternions (t, ..., 4) of the frames from `first` on are unit; NaN passes.

    Raises FileError with the first frame that is not.
    """
    norm = np.linalg.norm(quat, axis=-1).reshape(len(quat), -1)
    wrong = np.flatnonzero(((norm < NORM_MIN) | (norm > NORM_MAX)).any(axis=1))
    if len(wrong):
        worst = float(norm[wrong[0]][np.nanargmax(np.abs(norm[wrong[0]] - 1.0))])
        problem = f"{what} at frame {first + wrong[0]} has norm {worst:.3g}, wanted {NORM_MIN} to {NORM_MAX}."
        raise FileError(path, problem, "It is not a unit quaternion: check the columns.")
