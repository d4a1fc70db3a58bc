"""Build a robot's arrays and model files from the tables of its folder."""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.files import digest
from pipeline.robot.description import HUMAN_SITES, JOINTS, Description
from pipeline.robot.legs import mirror_index, mirror_sign
from pipeline.robot.model_files import render_mjcf, render_urdf
from pipeline.robot.robot import Robot, Tree, forward
from pipeline.robot.robot_error import refuse
from pipeline.robot.tables import LinkRow

COLUMNS = {
    **{"joint_lower": "lower", "joint_upper": "upper", "default_joint_pos": "default_pos"},
    **{"torque_limit": "torque", "motor_speed_limit": "motor_speed", "retarget_speed_limit": "speed"},
    **{"armature": "armature", "kp": "kp", "kd": "kd"},
}
"""Fields of a robot, each a number for every joint -> column or property of the joints table."""


def build_robot(source: Description) -> Robot:
    """The robot of a checked description. Raises RobotError if left and right are not mirror images."""
    config, tree = source.config, build_tree(source)
    joint_names = tuple(row.joint for row in source.joints)
    partner = mirror_index(joint_names, config.mirror_names)
    height = default_root_height(source, tree)
    mjcf, urdf = render_mjcf(source, height), render_urdf(source)
    return Robot(
        name=source.name,
        digest=digest.of_json({"mjcf": mjcf, "urdf": urdf, **source.contents}),
        mjcf=mjcf,
        urdf=urdf,
        tree=tree,
        total_mass=float(np.array([row.mass for row in source.links]).sum()),
        joint_names=joint_names,
        controlled=tuple(row.joint for row in source.joints if row.controlled),
        **{name: _column(source, column) for name, column in COLUMNS.items()},
        default_root_height=height,
        mirror_index=partner,
        mirror_sign=_signs(source, tree, partner),
        link_mirror_index=mirror_index(tree.link_names, config.mirror_names),
        hands=config.hands,
        feet=config.feet,
        sole_corners=config.sole_corners,
        key_links=config.key_links,
        human={**config.human_links, **{site: site for site in HUMAN_SITES}},
        namings=source.namings,
    )


def build_tree(source: Description) -> Tree:
    """Kinematic tree of the links table, with the sites."""
    links = {row.link: index for index, row in enumerate(source.links)}
    joints = {row.joint: index for index, row in enumerate(source.joints)}
    return Tree(
        link_names=source.link_names,
        parent=np.array([links.get(row.parent, -1) for row in source.links]),
        joint=np.array([joints.get(row.joint, -1) for row in source.links]),
        pos=np.array([row.numbers("x", "y", "z") for row in source.links]),
        quat=np.array([_origin_quat(row) for row in source.links]),
        axis=np.array([row.numbers("axis_x", "axis_y", "axis_z") for row in source.links]),
        site_names=tuple(row.site for row in source.sites),
        site_link=np.array([links[row.link] for row in source.sites]),
        site_pos=np.array([row.numbers("x", "y", "z") for row in source.sites]),
    )


def default_root_height(source: Description, tree: Tree) -> float:
    """Height [m] of the root over the lowest sole corner in the default pose, to the micrometre."""
    default = _column(source, "default_pos")
    pos, quat = forward(tree, np.zeros((1, 3)), rotation.IDENTITY[None], default[None])
    corners = [tree.site_names.index(name) for corners in source.config.sole_corners for name in corners]
    link = tree.site_link[corners]
    height = pos[0, link, 2] + rotation.rotate(quat[0, link], tree.site_pos[corners])[:, 2]
    return round(-float(height.min()), 6)


def _signs(source: Description, tree: Tree, partner: np.ndarray) -> np.ndarray:
    signs = mirror_sign(tree.joint_axes_root(), partner)
    path, faults = source.folder / JOINTS, []
    for row, index, sign in zip(source.joints, partner, signs, strict=True):
        if sign == 0.0:
            problem = f"the axis of joint '{row.joint}' is no mirror image of that of '{source.joints[index].joint}'."
            do = "Correct the axes in the links table or mirror_names."
            faults.append(FileError(path, problem, do, row.line))
    refuse(faults)
    return signs


def _origin_quat(row: LinkRow) -> np.ndarray:
    """URDF angles: rotations about the fixed x, then y, then z axis."""
    quat_xyzw = Rotation.from_euler("xyz", row.numbers("roll", "pitch", "yaw")).as_quat()
    return np.roll(quat_xyzw, 1)


def _column(source: Description, name: str) -> np.ndarray:
    return np.array([getattr(row, name) for row in source.joints])
