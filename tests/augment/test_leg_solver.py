"""Legs that follow their feet, against the robot's own forward kinematics."""

import numpy as np
import pytest

from pipeline.augment import leg_solver
from pipeline.augment.leg_solver import legs_of, lift_in_swings, offset_by_stance, reach, shortest_jerk
from pipeline.robot import Kinematics, Robot
from tests.factories.robot_clips import standing


def _poses(robot: Robot, joint_pos: np.ndarray):
    count = len(joint_pos)
    return Kinematics(robot).forward(np.zeros((count, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), joint_pos)


def _drawn(robot: Robot, spread: float, count: int = 200, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Joints of bent legs, and others about them [rad]."""
    rng = np.random.default_rng(seed)
    bent = robot.default_joint_pos + [0.4 * ("Knee" in name) for name in robot.joint_names]
    joint_pos = np.tile(bent, (count, 1)) + rng.normal(0.0, 0.1, (count, len(robot.joint_names)))
    return joint_pos, joint_pos + rng.normal(0.0, spread, joint_pos.shape)


def test_the_legs_hang_on_what_both_share(robot: Robot):
    for side, leg in zip(("Left", "Right"), legs_of(robot), strict=True):
        names = [robot.joint_names[joint] for joint in leg.joints]
        assert names[0] == f"{side}_Hip_Pitch" and names[-1] == f"{side}_Ankle_Roll" and len(names) == 6
        assert robot.link_names[leg.base] == "Waist"


@pytest.mark.parametrize("side", [0, 1])
def test_joints_that_are_found_put_the_foot_where_it_was(robot: Robot, side: int):
    there, start = _drawn(robot, spread=0.05)
    leg, poses = legs_of(robot)[side], _poses(robot, there)
    base, foot = ((poses.pos_w[:, link], poses.quat_w[:, link]) for link in (leg.base, leg.links[-1]))
    found = reach(robot.tree, leg, base, foot, start[:, leg.joints])
    assert found.reached.all()
    back = there.copy()
    back[:, leg.joints] = found.joint_pos
    again = _poses(robot, back)
    np.testing.assert_allclose(again.pos_w[:, leg.links[-1]], foot[0], atol=1e-6)
    assert np.abs(np.sum(again.quat_w[:, leg.links[-1]] * foot[1], axis=1)).min() > 1.0 - 1e-12
    np.testing.assert_allclose(found.joint_pos, there[:, leg.joints], atol=1e-5)


def test_the_jacobian_is_that_of_finite_differences(robot: Robot):
    joint_pos, _ = _drawn(robot, spread=0.0, count=5)
    leg, poses = legs_of(robot)[0], _poses(robot, joint_pos)
    base, foot = ((poses.pos_w[:, link], poses.quat_w[:, link]) for link in (leg.base, leg.links[-1]))
    own = joint_pos[:, leg.joints]
    _, jacobian = leg_solver._error_and_jacobian(robot.tree, leg, base, foot, own)
    for joint in range(6):
        step = 1e-6 * np.eye(6)[joint]
        up, _ = leg_solver._error_and_jacobian(robot.tree, leg, base, foot, own + step)
        down, _ = leg_solver._error_and_jacobian(robot.tree, leg, base, foot, own - step)
        np.testing.assert_allclose(jacobian[:, :, joint], (down - up) / 2e-6, atol=1e-7)


def test_a_foot_out_of_reach_is_missed_by_what_the_leg_lacks(robot: Robot):
    clip = standing(robot, seconds=0.1)
    leg = legs_of(robot)[0]
    poses = Kinematics(robot).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    base, foot = ((poses.pos_w[:, link], poses.quat_w[:, link]) for link in (leg.base, leg.links[-1]))
    down = (foot[0] - [0.0, 0.0, 0.3], foot[1])
    found = reach(robot.tree, leg, base, down, clip.joint_pos[:, leg.joints])
    assert not found.reached.any()
    assert np.all(found.miss > 0.2)


def test_an_offset_is_that_of_the_middle_of_each_stance():
    contact = np.zeros(60, dtype=bool)
    contact[10:21] = contact[40:51] = True
    offset = offset_by_stance(contact, lambda frame: np.array([float(frame), 0.0, 0.0]))
    np.testing.assert_array_equal(offset[10:21, 0], 15.0)
    np.testing.assert_array_equal(offset[40:51, 0], 45.0)
    assert offset[0, 0] == 0.0 and offset[-1, 0] == 59.0
    assert np.all(np.diff(offset[20:41, 0]) > 0.0)


def test_between_stances_goes_the_polynomial_that_six_conditions_give():
    """Place, speed and acceleration at both ends: 0, 0, 0 and 1, 0, 0."""
    powers = np.arange(6)

    def derivative(order: int, at: float) -> np.ndarray:
        factor = np.prod([powers - each for each in range(order)], axis=0) if order else np.ones(6)
        return factor * np.where(powers >= order, float(at) ** np.maximum(powers - order, 0), 0.0)

    conditions = np.array([derivative(order, at) for at in (0.0, 1.0) for order in range(3)])
    factors = np.linalg.solve(conditions, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    along = np.linspace(0.0, 1.0, 23)
    np.testing.assert_allclose(shortest_jerk(along), along[:, None] ** powers @ factors, atol=1e-12)


@pytest.mark.parametrize("highest", [18, 20, 22])
def test_a_lift_is_largest_where_the_foot_is_highest_and_level_there(highest: int):
    contact = np.ones(60, dtype=bool)
    contact[1:40] = False  # 39 frames; the stances before and after it are 40 steps apart
    height = -np.abs(np.arange(60.0) - highest)
    lift = lift_in_swings(contact, height, 50.0)
    assert int(np.argmax(lift)) == highest and lift[highest] == pytest.approx(1.0)
    assert lift[highest - 1] == pytest.approx(lift[highest + 1], abs=2e-3)
    np.testing.assert_array_equal(lift[contact], 0.0)
    assert lift[1] < 2e-3 and lift[39] < 2e-3
