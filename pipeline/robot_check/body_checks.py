"""Checks of masses, inertias, links of human body parts, and left-right symmetry."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.robot import Kinematics, Robot
from pipeline.robot.description import HUMAN_SITES, LINKS, SIDES, Description
from pipeline.robot.tables import LinkRow, ShapeRow

HEAVIEST_SHARE = 0.6
"""Largest share of the robot's mass in one link."""
COM_OUTSIDE = 0.1
"""Largest distance of a centre of mass from the bounds of the link's shapes [m]."""
GYRATION = (0.05, 2.0)
"""Least and largest radius of gyration about the slowest axis, over half the diagonal of the link's shapes."""
MIRRORED_LIMIT = 0.05
"""Largest difference of mirrored position limits [rad]; the T1's shoulders differ by 0.007."""
MIRRORED_SHARE = 0.05
"""Largest relative difference of mirrored torques, speeds, armatures and gains."""
MIRRORED_PLACE = 0.005
"""Largest difference of mirrored sites [m]."""
MIRRORED_POSE = 0.01
"""Largest difference of mirrored default positions [rad]."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A missing or contradictory value in a robot folder."""

    code: str
    """Short name of the check, for counting."""
    text: str
    """Description with the link, joint or site, the value and the expected value."""

    def __str__(self) -> str:
        return f"{self.code}: {self.text}"


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
    largest = float(np.linalg.eigvalsh(row.inertia)[-1])
    half = 0.5 * float(np.linalg.norm(high - low))
    ratio = np.sqrt(largest / row.mass) / half
    if not GYRATION[0] <= ratio <= GYRATION[1]:
        text = f"link '{row.link}': a moment of inertia of {largest:.3g} kg m^2 at {row.mass:g} kg is that of a body"
        text += f" of {ratio:.2g} times the size of its shapes; {GYRATION[0]:g} to {GYRATION[1]:g} are expected"
        yield Finding(code="inertia", text=f"{text} ({LINKS}).")


def _bounds(shapes: list[ShapeRow]) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of spheres around shapes, in the link frame [m]."""
    centres = np.array([shape.numbers("x", "y", "z") for shape in shapes])
    reach = np.array([[float(np.linalg.norm(shape.size))] for shape in shapes])
    return (centres - reach).min(axis=0), (centres + reach).max(axis=0)


def key_links(robot: Robot) -> Iterator[Finding]:
    """Key links that do not begin with the root link, as tracking requires."""
    if not robot.key_links or robot.key_links[0] != robot.root_link:
        first = f"begin with '{robot.key_links[0]}'" if robot.key_links else "are empty"
        yield Finding(
            code="key_links", text=f"key_links {first}; they must begin with '{robot.root_link}' (robot.toml)."
        )


def human_parts(robot: Robot) -> Iterator[Finding]:
    """Human body parts whose links are in the wrong order or on the wrong side."""
    chains = [(side, ("pelvis", "thigh", "shank", "foot")) for side in SIDES]
    chains += [(side, ("trunk", "upper_arm", "forearm")) for side in SIDES]
    for side, parts in chains:
        names = [part if part in ("pelvis", "trunk") else f"{side}_{part}" for part in parts]
        for above, below in pairwise(names):
            if not _is_above(robot, robot.human[above], robot.human[below]):
                text = f"{below} is '{robot.human[below]}', which is not below {above}, '{robot.human[above]}'"
                yield Finding(code="human_links", text=f"{text} (robot.toml).")
    origins = _sites_at_zero(robot)
    for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist"):
        left, right = (origins[robot.human[f"{side}_{joint}"]][1] for side in SIDES)
        if left <= right:
            text = f"site 'left_{joint}' is at y = {left:.3f} m, 'right_{joint}' at {right:.3f} m, all joints at zero"
            yield Finding(code="human_sites", text=f"{text}; left is towards +y (sites.csv).")


def _is_above(robot: Robot, above: str, below: str) -> bool:
    return above != below and robot.link(above) in (0, *robot.tree.chain(robot.link(below)))


def _sites_at_zero(robot: Robot) -> dict[str, np.ndarray]:
    """Positions of all sites with the root at the origin and all joints at zero [m]."""
    places = Kinematics(robot).sites_of_pose(robot.site_names, np.zeros(len(robot.joint_names)))
    return dict(zip(robot.site_names, places, strict=True))


def mirrored_figures(robot: Robot) -> Iterator[Finding]:
    """A mirror map that is not an involution; joints whose values differ from their partners'."""
    partner, sign = robot.mirror_index, robot.mirror_sign
    for kind, names, index in (
        ("joint", robot.joint_names, partner),
        ("link", robot.link_names, robot.link_mirror_index),
    ):
        for place, name in enumerate(names):
            back = names[index[index[place]]]
            if back != name:
                text = f"{kind} '{name}' has the partner '{names[index[place]]}', whose partner is '{back}'"
                yield Finding(code="mirror_map", text=f"{text} (mirror_names in robot.toml).")
    for joint, name in enumerate(robot.joint_names):
        other = int(partner[joint])
        if other <= joint:
            continue
        swapped = sorted((sign[joint] * robot.joint_lower[other], sign[joint] * robot.joint_upper[other]))
        own = (robot.joint_lower[joint], robot.joint_upper[joint])
        pair = f"'{name}' and '{robot.joint_names[other]}'"
        if np.abs(np.subtract(own, swapped)).max() > MIRRORED_LIMIT:
            text = f"limits of {pair}: {own[0]:g} to {own[1]:g} rad, mirrored {swapped[0]:g} to {swapped[1]:g} rad"
            yield Finding(code="limits", text=f"{text}; they should agree within {MIRRORED_LIMIT:g} rad (joints.csv).")
        pose = float(robot.default_joint_pos[joint] - sign[joint] * robot.default_joint_pos[other])
        if abs(pose) > MIRRORED_POSE:
            text = f"default positions of {pair} are no mirror images: they differ by {pose:.3g} rad (joints.csv)."
            yield Finding(code="default_pose", text=text)
        for column in ("torque_limit", "motor_speed_limit", "retarget_speed_limit", "armature", "kp", "kd"):
            first, second = getattr(robot, column)[[joint, other]].tolist()
            if abs(first - second) > MIRRORED_SHARE * max(first, second):
                text = f"{column} of {pair}: {first:g} and {second:g} (joints.csv)."
                yield Finding(code="left_and_right", text=text)


def mirrored_sites(robot: Robot) -> Iterator[Finding]:
    """Left sites that are not mirror images of the right ones, all joints at zero."""
    place = _sites_at_zero(robot)
    pairs = [robot.hands, robot.feet]
    pairs += [(name, name.replace("left_", "right_", 1)) for name in HUMAN_SITES if name.startswith("left_")]
    flip = np.array([1.0, -1.0, 1.0])
    for left, right in pairs:
        away = float(np.linalg.norm(place[left] - flip * place[right]))
        if away > MIRRORED_PLACE:
            text = f"sites '{left}' and '{right}' are {1000 * away:.0f} mm from being mirror images"
            yield Finding(code="sites", text=f"{text}, all joints at zero (sites.csv).")
