"""Geometry of the robot for the planner and the solver: lengths, sole and limb axes, from its model."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.human_clip import FEET
from pipeline.errors import UnknownNameError
from pipeline.quality.retargeting import LIMBS
from pipeline.retarget.foot_plan import Sole
from pipeline.robot import Kinematics, Robot


@dataclass(frozen=True, kw_only=True)
class RobotBody:
    """Dimensions and axes of the robot, measured at joint angles of zero."""

    leg: float
    """Hip to knee plus knee to ankle, mean of both sides [m]."""
    hip_half_width: float
    """Half the distance of the hips [m]."""
    hip_adduction: Float[np.ndarray, " 2"]
    """Largest angle by which a hip brings the leg inward, (left, right) [rad]."""
    hip_centre_b: Float[np.ndarray, " 3"]
    """Midpoint of the hips in the pelvis link's frame [m]."""
    sole: Sole
    limb_axes_b: Float[np.ndarray, "8 3"]
    """Unit vector along each of `LIMBS` in the frame of the link that turns with it."""
    waist: int | None
    """Index of the controlled joint between trunk and pelvis that turns about z; None where there is none."""
    waist_sign: float
    """+1 if a larger waist angle turns the pelvis to the left relative to the trunk, -1 if to the right."""


def measure(robot: Robot) -> RobotBody:
    """Measure the robot's body from its kinematics at joint angles of zero."""
    kinematics = Kinematics(robot)
    poses = kinematics.forward(np.zeros((1, 3)), rotation.IDENTITY[None], np.zeros((1, len(robot.joint_names))))
    human = robot.human

    def site(name: str) -> np.ndarray:
        return kinematics.site_pos_w(poses, (name,))[0, 0]

    def point(name: str) -> np.ndarray:
        return site(human[name])

    axes = []
    for limb, upper, lower in LIMBS:
        quat_w = poses.quat_w[0, robot.link(human[limb])]
        axes.append(rotation.rotate_inverse(quat_w, rotation.normalize(point(lower) - point(upper))))
    bones = [[point(f"{side}_hip"), point(f"{side}_knee"), point(f"{side}_ankle")] for side in FEET]
    hips = [bone[0] for bone in bones]
    pelvis_pos_w = poses.pos_w[0, robot.link(human["pelvis"])]
    corners_b = np.array([site(name) for name in robot.sole_corners[0]]) - bones[0][2]
    waist, waist_sign = _waist(robot)
    return RobotBody(
        leg=float(np.mean([np.linalg.norm(np.diff(bone, axis=0), axis=-1).sum() for bone in bones])),
        hip_half_width=float(np.linalg.norm(hips[0] - hips[1])) / 2.0,
        hip_adduction=np.array([_adduction(robot, side) for side in range(2)]),
        hip_centre_b=(hips[0] + hips[1]) / 2.0 - pelvis_pos_w,
        sole=Sole(
            depth=float(-corners_b[:, 2].mean()),
            front=float(corners_b[:, 0].max()),
            rear=float(corners_b[:, 0].min()),
            half_width=float(np.ptp(corners_b[:, 1])) / 2.0,
        ),
        limb_axes_b=np.array(axes),
        waist=waist,
        waist_sign=waist_sign,
    )


def _waist(robot: Robot) -> tuple[int | None, float]:
    """The controlled joint between trunk and pelvis link that turns about z, and the sign with which it turns the
    pelvis.

    The pelvis may be a child of the trunk (T1), its parent (Unitree G1), or the same link (K1).
    """
    axes = robot.tree.joint_axes_root()
    above = {part: _joints_above(robot, robot.human[part]) for part in ("pelvis", "trunk")}
    for part, other, sense in (("pelvis", "trunk", 1.0), ("trunk", "pelvis", -1.0)):
        for joint in above[part]:
            turns = joint not in above[other] and abs(axes[joint][2]) > 0.9
            if turns and robot.joint_names[joint] in robot.controlled:
                return joint, sense * float(np.sign(axes[joint][2]))
    return None, 1.0


def _joints_above(robot: Robot, link: str) -> list[int]:
    """The joints from a link up to the root link."""
    joints, at = [], robot.link(link)
    while robot.tree.parent[at] >= 0:
        joints.append(int(robot.tree.joint[at]))
        at = int(robot.tree.parent[at])
    return joints


def _adduction(robot: Robot, side: int) -> float:
    """Limit of the hip joint that turns about x, toward the other leg [rad]."""
    name = FEET[side]
    joint, sign = _joint_about(0, robot, f"{name}_thigh", "pelvis")
    inward_is_negative = (sign > 0.0) == (side == 0)
    return float(-robot.joint_lower[joint] if inward_is_negative else robot.joint_upper[joint])


def ankle_pitch(robot: Robot, side: int) -> tuple[int, float]:
    """Index of the ankle joint that turns about y, and its sign: +1 if a smaller angle lifts the toes."""
    return _joint_about(1, robot, f"{FEET[side]}_foot", f"{FEET[side]}_shank")


def _joint_about(axis: int, robot: Robot, below: str, above: str) -> tuple[int, float]:
    """The joint between two links (by their human names) that turns about an axis of the root, and its sign."""
    axes = robot.tree.joint_axes_root()
    link, top = robot.link(robot.human[below]), robot.link(robot.human[above])
    while link not in (top, -1):
        joint = int(robot.tree.joint[link])
        if abs(axes[joint][axis]) > 0.9:
            return joint, float(axes[joint][axis])
        link = int(robot.tree.parent[link])
    raise UnknownNameError(f"joint about {'xyz'[axis]} from {above} to {below}", robot.human[below], robot.joint_names)
