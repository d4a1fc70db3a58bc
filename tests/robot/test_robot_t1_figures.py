"""The T1 against published figures that its tables do not contain."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from pipeline.robot import Robot, mujoco_model

PAPER_TORQUE = {"Waist": 25, "Hip_Pitch": 45, "Hip_Roll": 25, "Hip_Yaw": 25, "Knee_Pitch": 60}
"""The paper's table of limits [N m]."""
PAPER_SPEED = {"Waist": 12.57, "Hip_Pitch": 16.76, "Hip_Roll": 12.57, "Hip_Yaw": 12.57, "Knee_Pitch": 12.57}
"""The same [rad/s]."""
RETARGET_SPEED = {
    "AAHead_yaw": 12.56, "Head_pitch": 12.56, "Shoulder_Pitch": 7.33, "Shoulder_Roll": 7.33, "Elbow_Pitch": 7.33,
    "Elbow_Yaw": 7.33, "Waist": 7.1, "Hip_Pitch": 15.2, "Hip_Roll": 7.1, "Hip_Yaw": 7.1, "Knee_Pitch": 12.57,
    "Ankle_Pitch": 12.9, "Ankle_Roll": 12.4,
}  # fmt: skip
MOTORS = {  # joint: rotor inertia [kg m^2], gear ratio, motors on the joint (Booster's motor figures)
    "Knee_Pitch": (196.3e-6, 18, 1),
    "Hip_Pitch": (161.7e-6, 18, 1),
    "Hip_Roll": (76.5e-6, 25, 1),
    "Hip_Yaw": (76.5e-6, 25, 1),
    "Waist": (76.5e-6, 25, 1),
    "Ankle_Pitch": (26.2e-6, 36, 2),
    "Ankle_Roll": (26.2e-6, 36, 2),
    "Shoulder_Pitch": (21.8e-6, 36, 1),
    "Shoulder_Roll": (21.8e-6, 36, 1),
    "Elbow_Pitch": (21.8e-6, 36, 1),
    "Elbow_Yaw": (21.8e-6, 36, 1),
}
STANDING = 0.6791
"""Height [m] of the Trunk when booster_train's default pose stands on its soles."""


def without_side(joint: str) -> str:
    return joint.removeprefix("Left_").removeprefix("Right_")


def by_joint(robot: Robot, values: np.ndarray, names: dict) -> list[tuple[float, float]]:
    """(ours, published) for each joint of `robot` whose name without its side is in `names`."""
    pairs = [(name, without_side(name)) for name in robot.joint_names]
    return [(values[robot.joint(name)], names[short]) for name, short in pairs if short in names]


def standing(robot: Robot, joint_pos: np.ndarray) -> mujoco.MjData:
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], joint_pos])
    mujoco.mj_forward(model, data)
    return data


def test_it_has_23_joints_of_which_21_are_controlled(t1: Robot):
    assert len(t1.joint_names) == 23 and len(t1.link_names) == 24
    assert set(t1.joint_names) - set(t1.controlled) == {"AAHead_yaw", "Head_pitch"}
    assert t1.controlled_index.tolist() == list(range(2, 23))
    assert t1.joint_names[10] == "Waist" and t1.joint_names[22] == "Right_Ankle_Roll"


def test_it_weighs_31_73_kg(t1: Robot):
    assert t1.total_mass == pytest.approx(31.73, abs=0.005)


def test_the_default_pose_stands_as_published(t1: Robot):
    assert t1.default_root_height == pytest.approx(STANDING, abs=5e-5)
    data = standing(t1, t1.default_joint_pos)
    assert data.subtree_com[0] == pytest.approx([0.06159, -1e-5, -0.08434], abs=5e-5)
    assert data.body("left_foot_link").xpos == pytest.approx([0.04001, 0.10625, -0.63585], abs=1e-5)
    assert data.body("right_hand_link").xpos == pytest.approx([0.01783, -0.20883, 0.02294], abs=1e-5)


def test_the_zero_pose_stands_as_published(t1: Robot):
    data = standing(t1, np.zeros(23))
    assert data.subtree_com[0] == pytest.approx([0.05561, -1e-5, -0.07032], abs=5e-5)
    assert data.body("right_foot_link").xpos == pytest.approx([0.0485, -0.10625, -0.64335], abs=1e-5)
    assert data.site("left_sole_centre").xpos[2] == pytest.approx(-0.6866, abs=1e-5)


def test_torques_and_motor_speeds_are_those_of_the_paper(t1: Robot):
    for ours, published in by_joint(t1, t1.torque_limit, PAPER_TORQUE) + by_joint(
        t1, t1.motor_speed_limit, PAPER_SPEED
    ):
        assert ours == published


def test_the_retargeting_bound_is_the_smaller_of_model_and_motor(t1: Robot):
    compared = by_joint(t1, t1.retarget_speed_limit, RETARGET_SPEED)
    assert len(compared) == 23
    for ours, published in compared:
        assert ours == published


def test_armatures_are_rotor_inertia_times_gear_ratio_squared(t1: Robot):
    compared = by_joint(
        t1, t1.armature, {name: count * inertia * gear**2 for name, (inertia, gear, count) in MOTORS.items()}
    )
    assert len(compared) == 21
    for ours, derived in compared:
        assert ours == pytest.approx(derived, rel=1e-6)


def test_each_link_of_an_arm_and_a_leg_is_as_long_as_its_joint_distance(t1: Robot):
    data = standing(t1, np.zeros(23))

    def distance(a: str, b: str) -> float:
        return float(np.linalg.norm(data.site(a).xpos - data.site(b).xpos))

    assert distance("left_hip", "left_knee") == pytest.approx(0.2163, abs=1e-4)  # sqrt(.081854+.134)^2+.014^2
    assert distance("left_knee", "left_ankle") == pytest.approx(0.2920, abs=1e-4)  # .280 + .012
    assert distance("right_shoulder", "right_elbow") == pytest.approx(0.2076, abs=1e-4)  # .0605 + .1471
    assert distance("right_elbow", "right_hand") == pytest.approx(0.216, abs=1e-4)
