"""A mirrored clip against the reflection of points in space."""

import numpy as np
import pytest

from pipeline.augment.mirror import mirror_numbers, mirror_skill
from pipeline.quality.planar_motion import command_velocity
from pipeline.robot import Kinematics, Robot
from pipeline.robot.mirror_image import mirror_clip
from tests.factories.robot_clips import wandering


def test_a_mirror_twice_gives_the_clip_again(robot: Robot):
    clip = wandering(robot)
    twice = mirror_clip(mirror_clip(clip, robot, "once"), robot, clip.name)
    for field in ("root_pos_w", "root_quat_w", "joint_pos", "contacts"):
        np.testing.assert_array_equal(getattr(twice, field), getattr(clip, field))


def test_hands_and_feet_are_where_the_reflection_of_the_others_is(robot: Robot):
    clip = wandering(robot)
    image = mirror_clip(clip, robot, "image")
    kinematics = Kinematics(robot)
    sites = (*robot.hands, *robot.feet)
    left_right = [sites.index(name) for name in (robot.hands[1], robot.hands[0], robot.feet[1], robot.feet[0])]
    there = kinematics.site_pos_w(kinematics.forward(image.root_pos_w, image.root_quat_w, image.joint_pos), sites)
    here = kinematics.site_pos_w(kinematics.forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos), sites)
    np.testing.assert_allclose(there, here[:, left_right] * [1.0, -1.0, 1.0], atol=2e-3)


def test_velocities_change_sideways_and_turning_alone(robot: Robot):
    clip = wandering(robot)
    image = mirror_clip(clip, robot, "image")
    before = command_velocity(clip.root_pos_w, clip.root_quat_w, clip.fps)
    after = command_velocity(image.root_pos_w, image.root_quat_w, image.fps)
    assert abs(before.lateral_m_s) > 0.05
    assert abs(before.yaw_rate_rad_s) > 0.3
    assert after.forward_m_s == pytest.approx(before.forward_m_s)
    assert after.lateral_m_s == pytest.approx(-before.lateral_m_s)
    assert after.yaw_rate_rad_s == pytest.approx(-before.yaw_rate_rad_s)


def test_contacts_change_sides(robot: Robot):
    clip = wandering(robot)
    assert clip.contacts is not None
    image = mirror_clip(clip, robot, "image")
    np.testing.assert_array_equal(image.contacts, np.stack([clip.contacts[:, 1], clip.contacts[:, 0]], axis=1))


@pytest.mark.parametrize(
    ("skill", "mirrored"),
    [("turn_left", "turn_right"), ("side_right", "side_left"), ("walk", "walk"), ("walk_fast_jog", "walk_fast_jog")],
)
def test_a_skill_with_a_side_changes_it(skill: str, mirrored: str):
    assert mirror_skill(skill) == mirrored
    assert mirror_skill(mirrored) == skill


def test_what_was_said_of_the_clip_is_mirrored():
    said = {
        "lateral_m_s": 0.3,
        "yaw_rate_rad_s": -1.0,
        "forward_m_s": 0.5,
        "skill": "side_left",
        "source": "left/right",
    }
    assert mirror_numbers(said) == {
        "lateral_m_s": -0.3,
        "yaw_rate_rad_s": 1.0,
        "forward_m_s": 0.5,
        "skill": "side_right",
        "source": "left/right",
    }


def test_numbers_of_one_side_go_to_the_other():
    said = {"contact_share_left": 0.7, "contact_share_right": 0.5, "heading_rad": 0.3, "origin_y_m": 2.0}
    mirrored = {"contact_share_left": 0.5, "contact_share_right": 0.7, "heading_rad": -0.3, "origin_y_m": -2.0}
    assert mirror_numbers(said) == mirrored and mirror_numbers(mirrored) == said
