"""Shared code of the robot readers: identify the robot of a file, and make its clip from checked columns.

Files may not state the order of unnamed joints and of the root's quaternion (wxyz or xyzw). Joints are in the robot's
own order, or breadth-first as in Isaac Lab. If an archive has positions of bodies, these verify the orders by forward
kinematics; otherwise `quaternion_order.py` infers the quaternion's order.
"""

import functools
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.outcome import Reason
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import AmbiguousFileError, FileError
from pipeline.readers.quaternion_order import MAX_TILT_DEG, ORDERS, in_order, inferred_order, trunk_tilt_deg
from pipeline.readers.raw_motion import check_unit, refuse_pose
from pipeline.readers.source import NOTHING_STATED, Statement
from pipeline.readers.velocity_rate import VelocityRate, frame_rate
from pipeline.robot import Kinematics, Robot, load_robot
from pipeline.robot.load import ROBOTS

MAX_ANGLE = 2.0 * np.pi
"""Largest plausible joint angle of a humanoid [rad]; larger ones are in degrees."""
LIMIT_MARGIN = 0.3
"""Violation of a joint limit [rad] above which the angle is another joint's or robot's."""
BEYOND = 0.1
"""Largest share of frames in which an unnamed joint may be beyond its limits."""


@dataclass(frozen=True, kw_only=True)
class RobotMotion:
    """A robot's motion as stored in a file: t frames, j joints in the file's order."""

    format: str
    path: Path
    root_pos_w: Float[np.ndarray, "t 3"]
    """[m]"""
    root_quat: Float[np.ndarray, "t 4"]
    """Root orientation in the order `quat_order`."""
    quat_order: str = "wxyz"
    """`wxyz` or `xyzw`; if not certain, the usual order of the format."""
    order_is_certain: bool = True
    """Whether the file names the quaternion's columns, or the format defines their order."""
    joint_pos: Float[np.ndarray, "t j"]
    """[rad]"""
    joint_names: tuple[str, ...] | None
    """Names of the columns of `joint_pos`; None if the file has none."""
    robot: str = ""
    """Robot stated by the file, which distinguishes robots with the same joints; empty if not stated."""
    fps: float | None
    """Frames per second as declared by the file [Hz]."""
    rate_fault: FileError | None = None
    """Error in the file's rate, if it has no valid one."""
    body_pos_w: Float[np.ndarray, "t b 3"] | None = None
    """World positions of bodies in any order [m], to check the joints' order."""
    rate_by_velocity: VelocityRate | None = None
    """Rate inferred from the file's own velocities."""
    notes: tuple[Reason, ...] = ()


@functools.cache
def robots() -> tuple[Robot, ...]:
    """All robots of the project."""
    return tuple(load_robot(folder.name) for folder in sorted(ROBOTS.iterdir()) if (folder / "robot.toml").is_file())


def to_robot_clip(
    motion: RobotMotion, name: str, fps: float | None, statement: Statement = NOTHING_STATED
) -> tuple[RobotClip, tuple[Reason, ...]]:
    """The clip with joints in the robot's order, and notes on the inferred orders.

    None for `fps` raises AmbiguousFileError once the robot is known. Raises FileError, and AmbiguousFileError for
    joints and quaternions whose order can't be inferred.
    """
    path = motion.path
    robot, columns = robot_of(path, motion.joint_pos.shape[1], motion.joint_names, motion.robot)
    refuse_pose(path, len(motion.joint_pos))
    rate = frame_rate(path, fps, statement, motion.rate_fault)
    check_unit(path, motion.root_quat, "the root's quaternion")
    if float(np.nanmax(np.abs(motion.joint_pos), initial=0.0)) > MAX_ANGLE:
        joint = robot.joint_names[int(np.nanargmax(np.nanmax(np.abs(motion.joint_pos[:, columns]), axis=0)))]
        worst = float(np.nanmax(np.abs(motion.joint_pos)))
        problem = f"joint '{joint}' reaches {worst:.1f} rad, a joint turns {MAX_ANGLE:.2f} at most."
        raise FileError(path, problem, "Convert degrees to radians.")
    if motion.body_pos_w is None:
        _check_limits(motion, robot, columns)
        order, notes = _quaternion_order(motion, robot, columns, rate, statement)
        _check_upright(path, in_order(motion.root_quat, order))
    else:
        order, columns, notes = _proved_orders(motion, robot, columns, statement)
    quat = rotation.normalize(in_order(motion.root_quat, order))
    valid = np.isfinite(quat).all(axis=1)
    quat[valid] = rotation.make_continuous(quat[valid])
    return robot.clip(name, rate, motion.root_pos_w, quat, motion.joint_pos[:, columns]), notes


def robot_of(path: Path, count: int, names: tuple[str, ...] | None, stated: str = "") -> tuple[Robot, list[int]]:
    """The robot with this number of joints, or with these joint names in one of its namings, and the column of each of
    its joints.

    Raises FileError for the file of another robot, AmbiguousFileError if the joints match several robots and the file
    states none of them.
    """
    known = ", ".join(f"{robot.name} ({len(robot.joint_names)})" for robot in robots())
    if names is None:
        fitting = [robot for robot in robots() if len(robot.joint_names) == count]
        if not fitting:
            problem = f"it is of another robot: a frame has {count} joints without names; the robots here are {known}."
            raise FileError(path, problem, "A new robot is a folder in robots/ (docs/robot.md).")
        what, do = f"{count} joints without names", "Add the joints' names to the file."
        return _stated_one(path, fitting, stated, what, do), list(range(count))
    fitting = [robot for robot in robots() if set(robot.joint_names) == set(robot.own_names(names))]
    if fitting:
        do = "Write a line `# robot: NAME` above a CSV's header, or rename the joints of one of them."
        robot = _stated_one(path, fitting, stated, "the names of its joints", do)
        own = robot.own_names(names)
        twice = [name for name in robot.joint_names if own.count(name) > 1]
        if twice:
            raise FileError(path, f"joint '{twice[0]}' of {robot.name} is named twice.", "Leave each joint once.")
        if len(own) != count:
            raise FileError(path, f"it names {len(own)} joints, and a frame has {count}.")
        return robot, [own.index(joint) for joint in robot.joint_names]
    alike = [(len(set(robot.joint_names) & set(robot.own_names(names))), robot) for robot in robots()]
    nearest = max(alike, key=lambda pair: pair[0])[1]
    names = nearest.own_names(names)
    missing = ", ".join(sorted(set(nearest.joint_names) - set(names))) or "none"
    extra = ", ".join(sorted(set(names) - set(nearest.joint_names))[:12]) or "none"
    problem = (
        f"it is of another robot: its joints are no robot's; the robots here are {known}. For '{nearest.name}' "
        f"missing: {missing}; extra: {extra}."
    )
    raise FileError(path, problem)


def _stated_one(path: Path, fitting: list[Robot], stated: str, what: str, do: str) -> Robot:
    """The only robot, or the one stated by the file. Raises AmbiguousFileError."""
    for robot in fitting:
        if len(fitting) == 1 or robot.name == stated:
            return robot
    found = ", ".join(robot.name for robot in fitting)
    raise AmbiguousFileError(path, f"{what} fit several robots: {found}.", do)


def _quaternion_order(
    motion: RobotMotion, robot: Robot, columns: list[int], fps: float, statement: Statement
) -> tuple[str, tuple[Reason, ...]]:
    """The order of the root's quaternion: stated, certain, or inferred with a note if it is unusual."""
    stated = _stated_order(motion.path, statement)
    if stated is not None:
        return stated, ()
    if motion.order_is_certain:
        return motion.quat_order, ()
    found = (motion.root_quat, motion.root_pos_w, motion.joint_pos[:, columns])
    order = inferred_order(motion.path, motion.quat_order, *found, robot, fps)
    if order == motion.quat_order:
        return order, ()
    text = (
        f"the file does not name the order of its quaternion; as {motion.quat_order}, which is usual, the robot would "
        f"lie or its standing soles slide, as {order} they do not, which is taken"
    )
    return order, (Reason(code="quaternion_order", text=text, effect="noted"),)


def _check_upright(path: Path, quat: Float[np.ndarray, "t 4"]) -> None:
    tilt_deg = trunk_tilt_deg(quat)
    if tilt_deg > MAX_TILT_DEG:
        problem = f"the trunk is tilted by {tilt_deg:.0f} degrees in the middle of its frames."
        raise FileError(path, problem, "The quaternion's order (wxyz or xyzw) or the up axis is not this format's.")


def _stated_order(path: Path, statement: Statement) -> str | None:
    if statement.quaternion is not None and statement.quaternion not in ORDERS:
        problem = f"the stated order of the quaternion is '{statement.quaternion}', expected {' or '.join(ORDERS)}."
        raise FileError(path, problem, "Correct `quaternion:` in data/sources.yaml.")
    return statement.quaternion


def _check_limits(motion: RobotMotion, robot: Robot, columns: list[int]) -> None:
    """Raise AmbiguousFileError for unnamed joints whose angles contradict the robot's order."""
    if motion.joint_names is not None:
        return
    joint_pos = motion.joint_pos[:, columns]
    over = (joint_pos > robot.joint_upper + LIMIT_MARGIN) | (joint_pos < robot.joint_lower - LIMIT_MARGIN)
    share = over.mean(axis=0)
    worst = int(share.argmax())
    if share[worst] > BEYOND:
        problem = (
            f"its joints have no names, and in {robot.name}'s order '{robot.joint_names[worst]}' is beyond its limits "
            f"in {share[worst]:.0%} of the frames: they are in another order, or it is another robot's file."
        )
        raise AmbiguousFileError(motion.path, problem, "Add the joints' names to the file.")


BREADTH_FIRST = (
    "its joints have no names; in {robot}'s own order its links would lie elsewhere than the file's bodies, "
    "breadth first (as Isaac Lab orders them) they are where the file has them, which is taken"
)
OTHER_QUATERNION = (
    "the root's quaternion is {order}, not as this format has it: so its links are where the file's bodies are"
)


def _proved_orders(
    motion: RobotMotion, robot: Robot, columns: list[int], statement: Statement
) -> tuple[str, list[int], tuple[Reason, ...]]:
    """The orders of quaternion and joints for which forward kinematics agrees with the file's bodies. Raises
    FileError."""
    named, bodies, path = motion.joint_names is not None, motion.body_pos_w, motion.path
    assert bodies is not None
    stated = _stated_order(path, statement)
    usual = motion.quat_order
    orders = [stated] if stated is not None else [usual, *(order for order in ORDERS if order != usual)]
    breadth_first = [robot.breadth_first.index(name) for name in robot.joint_names]
    worst = np.zeros(0)
    for order, joints in itertools.product(orders, [columns] if named else [columns, breadth_first]):
        quat = rotation.normalize(in_order(motion.root_quat, order))
        error = link_errors(robot, motion.root_pos_w, quat, motion.joint_pos[:, joints], bodies)
        if error is None:
            raise FileError(path, "no frame is complete: every row holds values that are not numbers.")
        worst = error if not len(worst) else worst
        if error.max() < MAX_LINK_ERROR:
            _check_upright(path, quat)
            texts = {} if joints == columns else {"joint_order": BREADTH_FIRST.format(robot=robot.name)}
            if order not in (usual, stated):
                texts["quaternion_order"] = OTHER_QUATERNION.format(order=order)
            return order, joints, tuple(Reason(code=code, text=text, effect="noted") for code, text in texts.items())
    _check_upright(path, in_order(motion.root_quat, orders[0]))
    problem = f"link '{robot.link_names[int(np.nanargmax(worst))]}' of {robot.name} would be {worst.max():.2f} m "
    do = "The joints' order, their signs or the quaternion's order differ."
    raise FileError(path, f"{problem}from any body of the file.", do if named else f"{do} Add joint_names to it.")


MAX_LINK_ERROR = 0.05
"""Largest distance of our model's links to the file's bodies [m], median over frames."""

FRAMES = 20
"""Number of frames that are compared, evenly spaced."""


def link_errors(
    robot: Robot,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
    body_pos_w: Float[np.ndarray, "t b 3"],
) -> Float[np.ndarray, " l"] | None:
    """Distance of each link to the file's nearest body [m], median over complete frames; None without such frames."""
    count = len(root_pos_w)
    arrays = (root_pos_w, root_quat_w, joint_pos, body_pos_w.reshape(count, -1))
    complete = np.flatnonzero(np.isfinite(np.concatenate(arrays, axis=1)).all(axis=1))
    if not len(complete):
        return None
    frames = np.unique(complete[np.linspace(0, len(complete) - 1, FRAMES).astype(int)])
    poses = Kinematics(robot).forward(root_pos_w[frames], root_quat_w[frames], joint_pos[frames])
    gaps = np.linalg.norm(poses.pos_w[:, :, None] - body_pos_w[frames][:, None], axis=-1).min(axis=2)
    return np.median(gaps, axis=0)
