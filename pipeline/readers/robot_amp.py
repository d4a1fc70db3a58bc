"""Isaac Lab AMP archives of a robot: joints by name, world poses of its links.

`dof_names`, `dof_positions` (t, j) [rad], `body_names`, `body_positions` (t, b, 3) [m], `body_rotations` (t, b, 4)
wxyz, `fps`; `body_linear_velocities` and `dof_velocities` show whether the rate is right.
"""

from __future__ import annotations

from pipeline.errors import FileError
from pipeline.files.array_file import ArrayFile
from pipeline.readers.isaac_amp import PARENTS as HUMANOID
from pipeline.readers.robot_motion import RobotMotion, robot_of, robots
from pipeline.readers.velocity_rate import rate_of_velocities, surest


def is_robot_amp(arrays: ArrayFile) -> bool:
    """An AMP archive of Isaac Lab that is not of its humanoid."""
    wanted = ("dof_names", "dof_positions", "body_names", "body_positions", "body_rotations")
    return arrays.has(*wanted) and not set(HUMANOID) <= set(arrays.texts("body_names"))


def read_robot_amp(arrays: ArrayFile) -> RobotMotion:
    """A robot's motion. Raises FileError."""
    bodies, joints = arrays.texts("body_names"), arrays.texts("dof_names")
    robot_of(arrays.path, len(joints), joints)
    root = next((robot.root_link for robot in robots() if robot.root_link in bodies), None)
    if root is None:
        raise FileError(arrays.path, f"no body is a robot's root link; there are: {', '.join(bodies[:12])}.")
    body_pos = arrays.numbers("body_positions", None, len(bodies), 3)
    frames = len(body_pos)
    body_quat = arrays.numbers("body_rotations", frames, len(bodies), 4)
    joint_pos = arrays.numbers("dof_positions", frames, len(joints))
    rates = []
    for name in ("body_linear_velocities", "dof_velocities"):
        arrays.refuse_other_length(name, "body_positions", frames)
    if arrays.shapes.get("body_linear_velocities") == body_pos.shape:
        rates.append(rate_of_velocities(body_pos, arrays.stored_numbers("body_linear_velocities", *body_pos.shape)))
    if arrays.shapes.get("dof_velocities") == joint_pos.shape:
        rates.append(rate_of_velocities(joint_pos, arrays.stored_numbers("dof_velocities", *joint_pos.shape)))
    return RobotMotion(
        format="robot_amp",
        path=arrays.path,
        root_pos_w=body_pos[:, bodies.index(root)],
        root_quat=body_quat[:, bodies.index(root)],
        joint_pos=joint_pos,
        joint_names=joints,
        fps=arrays.number("fps") if arrays.has("fps") else None,
        rate_by_velocity=surest(*rates),
        body_pos_w=body_pos,
    )
