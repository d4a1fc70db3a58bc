"""Feet that cross further than the hips adduct: each moves to its own side, in stances as in swings."""

import numpy as np
import pytest

from pipeline import rotation
from pipeline.retarget import foot_reach
from pipeline.retarget.foot_plan import YAW
from pipeline.retarget.foot_reach import Hips, bring_footholds_in_reach, bring_swings_in_reach, lacking
from pipeline.retarget.robot_body import measure
from pipeline.robot import Kinematics, Robot

FRAMES, WIDTH, HEIGHT, ADDUCTION = 60, 0.1, 0.55, 0.2


def crossing(yaw: float, cross: tuple[float, float]) -> tuple[np.ndarray, Hips, np.ndarray]:
    """Feet that are so far inward of their own hips (left, right) [m], the hips, and the unit vector to their left."""
    left_w = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    hips = np.array([4.0, -1.0, 0.0]) + np.array([[WIDTH], [-WIDTH]]) * left_w + [0.0, 0.0, HEIGHT]
    feet = np.zeros((2, FRAMES, 5))
    for side, sign in enumerate((1.0, -1.0)):
        feet[side, :, :3] = hips[side] - sign * cross[side] * left_w - [0.0, 0.0, HEIGHT]
        feet[side, :, YAW] = yaw
    pos_w = np.repeat(hips[None], FRAMES, axis=0)
    sine = np.full(2, np.sin(ADDUCTION))
    return feet, Hips(pos_w=pos_w, left_w=np.tile(left_w, (FRAMES, 1)), sin_adduction=sine), left_w[:2]


@pytest.mark.parametrize("angle", [0.1, 0.2, 0.3])
def test_a_foot_lacks_what_its_leg_is_turned_inward_beyond_the_limit(angle: float):
    feet, hips, _ = crossing(0.7, (HEIGHT * np.tan(angle), HEIGHT * np.tan(angle)))
    wanted = max(np.sin(angle) - np.sin(ADDUCTION), 0.0) * HEIGHT / np.cos(angle)
    np.testing.assert_allclose(lacking(feet, hips), wanted, atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 2.4])
@pytest.mark.parametrize("cross", [(0.2, 0.0), (0.0, 0.2), (0.2, 0.25)])
def test_footholds_move_outward_each_to_its_own_side(yaw: float, cross: tuple[float, float]):
    feet, hips, left_w = crossing(yaw, cross)
    before, short = feet.copy(), lacking(feet, hips)
    contacts = np.ones((FRAMES, 2), dtype=bool)
    largest = bring_footholds_in_reach(feet, contacts, np.full(FRAMES, yaw), hips, 0.0)
    moved = feet - before
    for side, sign in enumerate((1.0, -1.0)):
        np.testing.assert_allclose(moved[side, :, :2], sign * short[side][:, None] * left_w, atol=1e-12)
    np.testing.assert_array_equal(moved[..., 2:], 0.0)
    assert largest == pytest.approx(short.max())
    assert lacking(feet, hips).max() < 0.1 * short.max()


@pytest.mark.parametrize("side", [0, 1])
def test_a_swinging_foot_passes_further_outward_and_stances_stay(side: int):
    yaw = -1.1
    feet, hips, left_w = crossing(yaw, (0.25, 0.25))
    contacts = np.ones((FRAMES, 2), dtype=bool)
    contacts[15:45, side] = False
    before = feet.copy()
    bring_swings_in_reach(feet, contacts, np.full(FRAMES, yaw), hips, 0.0, 2.0)
    moved = (feet - before)[..., :2] @ left_w
    assert (moved[1 - side] == 0.0).all() and (moved[side, contacts[:, side]] == 0.0).all()
    assert (1.0 - 2.0 * side) * moved[side, 30] > 0.05


def test_hips_stand_where_trunk_and_waist_have_them(robot: Robot):
    """Against forward kinematics, with the trunk tilted and the waist turned."""

    body, joint_pos = measure(robot), robot.default_joint_pos.copy()[None]
    joint_pos[:, body.waist] = 0.6
    trunk = rotation.from_rotvec(np.array([[0.1, 0.2, 0.9]]))
    kinematics = Kinematics(robot)
    poses = kinematics.forward(np.array([[1.0, 2.0, 0.7]]), trunk, joint_pos)
    sites = kinematics.site_pos_w(poses, [robot.human["left_hip"], robot.human["right_hip"]])
    hips = foot_reach.hips_of(sites.mean(axis=1), trunk, joint_pos[:, body.waist], body)
    np.testing.assert_allclose(hips.pos_w, sites, atol=1e-9)
