"""The joints of the legs are found by the human correspondence."""

from __future__ import annotations

import pytest

from pipeline.robot import load_robot
from pipeline.robot.legs import legs_of


@pytest.mark.parametrize("name", ["t1", "k1"])
def test_hips_knees_and_ankles_are_those_of_the_names(name: str):
    robot = load_robot(name)
    legs = legs_of(robot)
    for side, joints, hip, knee, ankles in zip(
        ("Left", "Right"), legs.joints, legs.hip_pitch, legs.knee, legs.ankles, strict=True
    ):
        parts = ("Hip_Pitch", "Hip_Roll", "Hip_Yaw", "Knee_Pitch", "Ankle_Pitch", "Ankle_Roll")
        assert [robot.joint_names[joint] for joint in joints] == [f"{side}_{part}" for part in parts]
        assert robot.joint_names[hip] == f"{side}_Hip_Pitch"
        assert robot.joint_names[knee] == f"{side}_Knee_Pitch"
        assert [robot.joint_names[joint] for joint in ankles] == [f"{side}_Ankle_Pitch", f"{side}_Ankle_Roll"]
    of_leg = [any(part in joint for part in ("Hip", "Knee", "Ankle")) for joint in robot.joint_names]
    assert legs.all == tuple(index for index, found in enumerate(of_leg) if found)


def test_names_do_not_matter():
    robot = load_robot("t1").in_naming("booster_2026")
    assert legs_of(robot) == legs_of(load_robot("t1"))
