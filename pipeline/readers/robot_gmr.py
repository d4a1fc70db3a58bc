"""Robot trajectories of GMR and of ASAP: root position, root rotation xyzw and joints without names.

`root_pos` (t, 3) [m], `root_rot` (t, 4), `dof_pos` (t, j) [rad], `fps`; ASAP calls them `root_trans_offset`,
`root_rot`, `dof`. Joints are in the order of the robot's MuJoCo model;
`dof_names` may state another, and `root_rot_order` the quaternion's.
"""

from __future__ import annotations

from pipeline.errors import FileError
from pipeline.files.array_file import ArrayFile
from pipeline.readers.inferred_order import ORDERS
from pipeline.readers.robot_motion import RobotMotion

POSITIONS = ("root_pos", "root_trans_offset")
JOINTS = ("dof_pos", "dof")
NAMES = ("dof_names", "joint_names")


def is_gmr(arrays: ArrayFile) -> bool:
    """Arrays of a robot as GMR or ASAP name them."""
    return arrays.has("root_rot") and arrays.first(*POSITIONS) is not None and arrays.first(*JOINTS) is not None


def read_gmr(arrays: ArrayFile) -> RobotMotion:
    """A robot's motion. Raises FileError."""
    position, joints, names = arrays.first(*POSITIONS), arrays.first(*JOINTS), arrays.first(*NAMES)
    assert position is not None and joints is not None
    root_pos = arrays.numbers(position, None, 3)
    if not len(root_pos):
        raise FileError(arrays.path, "the file has no frames.")
    joint_pos = arrays.array(joints)
    if joint_pos.ndim == 3 and joint_pos.shape[2] == 1:
        joint_pos = joint_pos[:, :, 0]
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
        joint_names=arrays.texts(names) if names is not None else None,
        fps=arrays.number("fps") if arrays.has("fps") else None,
    )
