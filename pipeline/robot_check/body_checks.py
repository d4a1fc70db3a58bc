"""Masses, inertias, and the links that stand for parts of a person."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pipeline.robot import Robot
from pipeline.robot.description import LINKS, SIDES, Description
from pipeline.robot.tables import LinkRow, ShapeRow
from pipeline.robot_check.finding import Finding

HEAVIEST_SHARE = 0.6
"""Largest share of the robot's mass in one link."""
COM_OUTSIDE = 0.1
"""Largest distance of a centre of mass from the bounds of the link's shapes [m]."""
GYRATION = (0.05, 2.0)
"""Least and largest radius of gyration about the slowest axis, over half the diagonal of the link's shapes."""


def masses(description: Description, robot: Robot) -> Iterator[Finding]:
    """Links that are too heavy, or whose centre of mass or inertia does not fit their shapes."""
    for row in description.links:
        share = row.mass / robot.total_mass
        if share > HEAVIEST_SHARE:
            text = f"link '{row.link}' has {row.mass:g} kg, {100 * share:.0f} % of the robot"
            yield Finding(code="mass", text=f"{text}; at most {100 * HEAVIEST_SHARE:.0f} % are expected.")
        shapes = [shape for shape in description.shapes if shape.link == row.link]
        if shapes:
            yield from _fits(row, shapes)


def _fits(row: LinkRow, shapes: list[ShapeRow]) -> Iterator[Finding]:
    low, high = _bounds(shapes)
    com = np.array(row.numbers("com_x", "com_y", "com_z"))
    away = float(np.linalg.norm(com - np.clip(com, low, high)))
    if away > COM_OUTSIDE:
        text = f"link '{row.link}': the centre of mass is {away:.3f} m outside of its shapes"
        yield Finding(code="centre_of_mass", text=f"{text}; at most {COM_OUTSIDE:g} m are expected ({LINKS}).")
    xx, xy, xz, yy, yz, zz = row.numbers("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    largest = float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[-1])
    half = 0.5 * float(np.linalg.norm(high - low))
    ratio = np.sqrt(largest / row.mass) / half
    if not GYRATION[0] <= ratio <= GYRATION[1]:
        text = (
            f"link '{row.link}': a moment of inertia of {largest:.3g} kg m^2 at {row.mass:g} kg is that of a body of "
        )
        text += f"{ratio:.2g} times the size of its shapes"
        yield Finding(code="inertia", text=f"{text}; {GYRATION[0]:g} to {GYRATION[1]:g} are expected ({LINKS}).")


def _bounds(shapes: list[ShapeRow]) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of spheres around shapes, in the link frame [m]."""
    centres = np.array([shape.numbers("x", "y", "z") for shape in shapes])
    reach = np.array([[float(np.linalg.norm(shape.size))] for shape in shapes])
    return (centres - reach).min(axis=0), (centres + reach).max(axis=0)


def key_links(robot: Robot) -> Iterator[Finding]:
    """Key links that do not begin with the root link, which tracking takes the first one for."""
    if not robot.key_links or robot.key_links[0] != robot.root_link:
        first = f"begin with '{robot.key_links[0]}'" if robot.key_links else "are empty"
        yield Finding(
            code="key_links", text=f"key_links {first}; they must begin with '{robot.root_link}' (robot.toml)."
        )


def human_parts(robot: Robot) -> Iterator[Finding]:
    """Parts of a person whose links are not in the order of a body, or on the other side."""
    chains = [(side, ("pelvis", "thigh", "shank", "foot")) for side in SIDES]
    chains += [(side, ("trunk", "upper_arm", "forearm")) for side in SIDES]
    for side, parts in chains:
        names = [part if part in ("pelvis", "trunk") else f"{side}_{part}" for part in parts]
        for above, below in pairwise(names):
            if not _is_above(robot, robot.human[above], robot.human[below]):
                text = f"{below} is '{robot.human[below]}', which is not below {above}, '{robot.human[above]}'"
                yield Finding(code="human_links", text=f"{text} (robot.toml).")
    origins = _site_positions(robot)
    for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"):
        left, right = (origins[robot.human[f"{side}_{joint}"]][1] for side in SIDES)
        if left <= right:
            text = f"site 'left_{joint}' is at y = {left:.3f} m, 'right_{joint}' at {right:.3f} m, all joints at zero"
            yield Finding(code="human_sites", text=f"{text}; left is towards +y (sites.csv).")


def _is_above(robot: Robot, above: str, below: str) -> bool:
    link, top = robot.link(below), robot.link(above)
    while link >= 0 and link != top:
        link = int(robot.tree.parent[link])
    return link == top and above != below


def _site_positions(robot: Robot) -> dict[str, np.ndarray]:
    from pipeline.robot import Kinematics

    kinematics = Kinematics(robot)
    zero = np.zeros((1, len(robot.joint_names)))
    poses = kinematics.forward(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), zero)
    return dict(zip(robot.site_names, kinematics.site_pos_w(poses, robot.site_names)[0], strict=True))
