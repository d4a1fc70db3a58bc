"""Robot trajectories as named arrays: mjlab and whole-body tracking, MuJoCo `qpos` (LocoMuJoCo), Isaac Lab, GMR, ASAP.

mjlab: `joint_pos` (t, j) with `body_pos_w`, `body_quat_w` (the root link's, or the first body's); or with the root in
seven columns before the joints. `qpos` (t, 7 + j): position, quaternion wxyz, joints.

Isaac Lab AMP: `dof_names`, `dof_positions` (t, j) [rad], `body_names`, `body_positions` (t, b, 3) [m],
`body_rotations` (t, b, 4) wxyz, `fps`; `body_linear_velocities` and `dof_velocities` show whether the rate is right.

GMR: `root_pos` (t, 3) [m], `root_rot` (t, 4) xyzw, `dof_pos` (t, j) [rad], `fps`; ASAP calls them
`root_trans_offset`, `root_rot`, `dof`. Joints are in the order of the robot's MuJoCo model; `dof_names` may state
another, and `root_rot_order` the quaternion's.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pipeline.errors import AmbiguousFileError, FileError
from pipeline.files.array_file import ArrayFile
from pipeline.readers.isaac_amp import PARENTS as HUMANOID
from pipeline.readers.quaternion_order import ORDERS
from pipeline.readers.robot_motion import RobotMotion, robot_of, robots
from pipeline.readers.velocity_rate import VelocityRate, rate_of_velocities, surest


def is_robot(header: ArrayFile) -> bool:
    """Whether an archive has a robot's joints."""
    return header.has("qpos") or header.has("joint_pos")


def read_robot_npz(header: ArrayFile) -> RobotMotion:
    """A robot's motion. Raises FileError."""
    return _read_qpos(header) if header.has("qpos") else _read_joint_pos(header)


def _read_qpos(header: ArrayFile) -> RobotMotion:
    qpos = header.numbers("qpos", None, None)
    names = header.optional_texts("joint_names")
    if names is not None and len(names) == qpos.shape[1] - 6:
        names = names[1:]  # without the free joint
    header.refuse_other_length("qvel", "qpos", len(qpos))
    rate = None
    if header.shapes.get("qvel") == (len(qpos), qpos.shape[1] - 1):
        qvel = header.stored_numbers("qvel", len(qpos), qpos.shape[1] - 1)
        rate = surest(rate_of_velocities(qpos[:, :3], qvel[:, :3]), rate_of_velocities(qpos[:, 7:], qvel[:, 6:]))
    return RobotMotion(
        format="robot_qpos",
        path=header.path,
        root_pos_w=qpos[:, :3],
        root_quat=qpos[:, 3:7],
        order_is_certain=False,  # MuJoCo uses wxyz, but converted archives may have xyzw
        joint_pos=qpos[:, 7:],
        joint_names=names,
        fps=header.optional_number("fps", "frequency"),
        rate_by_velocity=rate,
        body_pos_w=_bodies(header, "xpos", len(qpos)),
    )


def _read_joint_pos(header: ArrayFile) -> RobotMotion:
    joint_pos, names = header.numbers("joint_pos", None, None), header.optional_texts("joint_names")
    if names is not None:
        robot_of(header.path, len(names), names)
    counts = {len(robot.joint_names) for robot in robots()} if names is None else {len(names)}
    bodies = _bodies(header, "body_pos_w", len(joint_pos))
    joints = joint_pos.shape[1] - 7
    nameless_bodies = 0 if names is not None or bodies is None else bodies.shape[1]
    if joints in counts and nameless_bodies <= joints + 1:
        root_pos, root_quat, joint_pos = joint_pos[:, :3], joint_pos[:, 3:7], joint_pos[:, 7:]
    elif bodies is not None:
        body_names = header.optional_texts("body_names")
        root = 0 if body_names is None else _root_index(header, body_names, names)
        root_pos = bodies[:, root]
        root_quat = header.numbers("body_quat_w", len(joint_pos), bodies.shape[1], 4)[:, root]
    else:
        raise FileError(header.path, "there is no root: neither body_pos_w nor seven columns before the joints.")
    if names is None and bodies is None:
        problem = "joint_pos has neither joint_names nor body_pos_w, so the joints' order can't be inferred."
        raise AmbiguousFileError(header.path, problem, "Add joint_names to the archive.")
    return RobotMotion(
        format="robot_npz",
        path=header.path,
        root_pos_w=root_pos,
        root_quat=root_quat,
        order_is_certain=False,
        joint_pos=joint_pos,
        joint_names=names,
        fps=header.optional_number("fps", "frequency"),
        rate_by_velocity=_rate(header, "joint_pos", {"body_lin_vel_w": bodies, "joint_vel": joint_pos}),
        body_pos_w=bodies,
    )


def _root_index(arrays: ArrayFile, bodies: tuple[str, ...], joints: tuple[str, ...] | None) -> int:
    """Index of the root link (of the robot whose joints these are) among the bodies. Raises FileError."""
    for robot in robots() if joints is None else (robot_of(arrays.path, len(joints), joints)[0],):
        if robot.root_link in bodies:
            return bodies.index(robot.root_link)
    raise FileError(arrays.path, f"no body is a robot's root link; there are: {', '.join(bodies[:12])}.")


def _bodies(header: ArrayFile, key: str, frames: int) -> Float[np.ndarray, "t b 3"] | None:
    """World positions of all bodies, if the archive has them."""
    if len(header.shapes.get(key, ())) != 3:
        return None
    return header.numbers(key, frames, None, 3)


def _rate(arrays: ArrayFile, than: str, positions: Mapping[str, np.ndarray | None]) -> VelocityRate | None:
    """The rate that fits the velocities of `positions` best. Raises FileError for other frames than those of `than`."""
    frames, rates = arrays.shapes[than][0], []
    for name, values in positions.items():
        arrays.refuse_other_length(name, than, frames)
        if values is not None and arrays.shapes.get(name) == values.shape:
            rates.append(rate_of_velocities(values, arrays.stored_numbers(name, *values.shape)))
    return surest(*rates)


def is_robot_amp(arrays: ArrayFile) -> bool:
    """Whether an archive is Isaac Lab AMP data of a robot, not of its humanoid."""
    wanted = ("dof_names", "dof_positions", "body_names", "body_positions", "body_rotations")
    return arrays.has(*wanted) and not set(HUMANOID) <= set(arrays.texts("body_names"))


def read_robot_amp(arrays: ArrayFile) -> RobotMotion:
    """A robot's motion. Raises FileError."""
    bodies, joints = arrays.texts("body_names"), arrays.texts("dof_names")
    root = _root_index(arrays, bodies, joints)
    body_pos = arrays.numbers("body_positions", None, len(bodies), 3)
    body_quat = arrays.numbers("body_rotations", len(body_pos), len(bodies), 4)
    joint_pos = arrays.numbers("dof_positions", len(body_pos), len(joints))
    velocities = {"body_linear_velocities": body_pos, "dof_velocities": joint_pos}
    return RobotMotion(
        format="robot_amp",
        path=arrays.path,
        root_pos_w=body_pos[:, root],
        root_quat=body_quat[:, root],
        joint_pos=joint_pos,
        joint_names=joints,
        fps=arrays.optional_number("fps"),
        rate_by_velocity=_rate(arrays, "body_positions", velocities),
        body_pos_w=body_pos,
    )


POSITIONS = ("root_pos", "root_trans_offset")
JOINTS = ("dof_pos", "dof")
NAMES = ("dof_names", "joint_names")


def is_gmr(arrays: ArrayFile) -> bool:
    """Whether arrays have the robot format of GMR or ASAP."""
    return arrays.has("root_rot") and arrays.first(*POSITIONS) is not None and arrays.first(*JOINTS) is not None


def read_gmr(arrays: ArrayFile) -> RobotMotion:
    """A robot's motion. Raises FileError."""
    position, joints = arrays.first(*POSITIONS), arrays.first(*JOINTS)
    assert position is not None and joints is not None
    root_pos = arrays.numbers(position, None, 3)
    if not len(root_pos):
        raise FileError(arrays.path, "the file has no frames.")
    if len(arrays.shapes.get(joints, ())) == 3:  # ASAP's
        joint_pos = arrays.numbers(joints, len(root_pos), None, 1)[:, :, 0]
    else:
        joint_pos = arrays.numbers(joints, len(root_pos), None)
    order = str(arrays.array("root_rot_order")) if arrays.has("root_rot_order") else None
    return RobotMotion(
        format="robot_gmr",
        path=arrays.path,
        root_pos_w=root_pos,
        root_quat=arrays.numbers("root_rot", len(root_pos), 4),
        quat_order=order if order in ORDERS else "xyzw",
        order_is_certain=order in ORDERS,
        joint_pos=joint_pos,
        joint_names=arrays.optional_texts(*NAMES),
        fps=arrays.optional_number("fps"),
    )
