"""Contacts of a robot's feet from its motion alone, against the forces of rollouts."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.repair_quality import f1
from pipeline.clips.robot_clip import RobotClip
from pipeline.repair.robot_motion import label_robot_contacts
from tests.factories.policy_walks import policy_walk

COMMANDS = [(0.6, 0.0, 0.0), (1.2, 0.0, 0.8), (-0.5, 0.0, 0.0)]


@pytest.fixture(scope="module")
def walks(policies, robot) -> list[RobotClip]:
    return [policy_walk(policies, robot, command, 4.0).clip("walk", start_s=1.0) for command in COMMANDS]


@pytest.mark.shared
def test_labels_agree_with_the_forces_of_the_ground(walks, robot):
    found = np.concatenate([label_robot_contacts(dataclasses.replace(clip, contacts=None), robot) for clip in walks])
    true = np.concatenate([clip.contacts for clip in walks])
    assert f1(found, true) >= 0.96


@pytest.mark.shared
def test_labels_do_not_depend_on_where_the_floor_lies(walks, robot):
    lifted = dataclasses.replace(walks[0], root_pos_w=walks[0].root_pos_w + np.array([0.0, 0.0, 0.4]))
    same = label_robot_contacts(lifted, robot) == label_robot_contacts(walks[0], robot)
    assert same.mean() > 0.995


def test_a_robot_that_stands_touches_with_both_feet(robot):
    count = 50
    clip = RobotClip(
        name="stand",
        fps=50.0,
        robot=robot.name,
        joint_names=robot.joint_names,
        root_pos_w=np.tile([0.0, 0.0, robot.default_root_height], (count, 1)),
        root_quat_w=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        joint_pos=np.tile(robot.default_joint_pos, (count, 1)),
    )
    assert label_robot_contacts(clip, robot).all()
