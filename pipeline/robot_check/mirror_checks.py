"""Left against right: the mirror map, limits, motors, masses, sites."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.robot import Kinematics, Robot
from pipeline.robot.description import HUMAN_SITES
from pipeline.robot_check.finding import Finding

LIMIT = 0.05
"""Largest difference of mirrored position limits [rad]; the T1's shoulders differ by 0.007."""
SHARE = 0.05
"""Largest relative difference of mirrored torques, speeds, armatures and gains."""
PLACE = 0.005
"""Largest difference of mirrored sites [m]."""
POSE = 0.01
"""Largest difference of mirrored default positions [rad]."""


def mirrored_figures(robot: Robot) -> Iterator[Finding]:
    """A mirror map that is no involution; joints whose figures are not those of their partners."""
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
        if np.abs(np.subtract(own, swapped)).max() > LIMIT:
            text = f"limits of {pair}: {own[0]:g} to {own[1]:g} rad, mirrored {swapped[0]:g} to {swapped[1]:g} rad"
            yield Finding(code="limits", text=f"{text}; they should agree within {LIMIT:g} rad (joints.csv).")
        pose = float(robot.default_joint_pos[joint] - sign[joint] * robot.default_joint_pos[other])
        if abs(pose) > POSE:
            text = f"default positions of {pair} are no mirror images: they differ by {pose:.3g} rad (joints.csv)."
            yield Finding(code="default_pose", text=text)
        for column in ("torque_limit", "motor_speed_limit", "retarget_speed_limit", "armature", "kp", "kd"):
            first, second = getattr(robot, column)[[joint, other]].tolist()
            if abs(first - second) > SHARE * max(first, second):
                text = f"{column} of {pair}: {first:g} and {second:g} (joints.csv)."
                yield Finding(code="left_and_right", text=text)


def mirrored_sites(robot: Robot) -> Iterator[Finding]:
    """Sites of the left that are not mirror images of those of the right, all joints at zero."""
    kinematics = Kinematics(robot)
    zero = np.zeros((1, len(robot.joint_names)))
    poses = kinematics.forward(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]), zero)
    place = dict(zip(robot.site_names, kinematics.site_pos_w(poses, robot.site_names)[0], strict=True))
    pairs = [robot.hands, robot.feet]
    pairs += [(name, name.replace("left_", "right_", 1)) for name in HUMAN_SITES if name.startswith("left_")]
    flip = np.array([1.0, -1.0, 1.0])
    for left, right in pairs:
        away = float(np.linalg.norm(place[left] - flip * place[right]))
        if away > PLACE:
            text = f"sites '{left}' and '{right}' are {1000 * away:.0f} mm from being mirror images"
            yield Finding(code="sites", text=f"{text}, all joints at zero (sites.csv).")
