"""Figures of a reference against its rollout's, on motions whose figures are known."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from pipeline.robot import Robot
from pipeline.tracking.before_after import before_after, by_skill, path_speed, touchdown_shifts
from pipeline.viewing.tracking_plots import before_and_after
from tests.factories.robot_clips import standing
from tests.factories.simulated_clip import simulated_standing


def test_a_motion_that_slides_sinks_and_shakes_is_seen_before_and_not_after(robot: Robot):
    rollout = standing(robot, seconds=2.0)
    frames = np.arange(rollout.frame_count)
    root = rollout.root_pos_w + np.stack([0.003 * frames, 0.0 * frames, 0.0 * frames - 0.02], axis=1)
    joints = rollout.joint_pos.copy()
    knee = robot.joint("Left_Knee_Pitch")
    joints[:, knee] += 0.01 * (-1.0) ** frames
    standing_feet = np.ones((rollout.frame_count, 2), dtype=bool)
    rollout = dataclasses.replace(rollout, contacts=standing_feet)
    reference = dataclasses.replace(rollout, root_pos_w=root, joint_pos=joints)
    found = before_after(reference, rollout, robot)
    assert found["slip_before_m_s"] == pytest.approx(0.003 * rollout.fps, rel=0.2)
    assert found["slip_after_m_s"] == pytest.approx(0.0, abs=1e-9)
    assert found["penetration_before_m"] == pytest.approx(found["penetration_after_m"] + 0.02, abs=0.003)
    shaking = 8 * 0.01 * rollout.fps**3 / len(robot.controlled)  # third difference of +a, -a, +a, -a is 8 a
    assert found["jerk_before_rad_s3"] == pytest.approx(shaking, rel=1e-6)
    assert found["jerk_after_rad_s3"] == pytest.approx(0.0, abs=1e-6)
    assert found["contact_changed"] == 0.0
    assert found["touchdown_shift_s"] is None and found["saturated_after"] is None


def test_saturation_is_that_of_the_joint_that_has_most(robot: Robot):
    rollout = simulated_standing(robot, 1.0)
    assert rollout.forces is not None
    torque = np.zeros_like(rollout.forces.joint_torque)
    knee = robot.joint("Left_Knee_Pitch")
    torque[:10, knee] = -robot.torque_limit[knee]
    torque[20:25, knee + 1] = robot.torque_limit[knee + 1]
    rollout = dataclasses.replace(rollout, forces=dataclasses.replace(rollout.forces, joint_torque=torque))
    assert before_after(rollout, rollout, robot)["saturated_after"] == pytest.approx(10 / rollout.frame_count)


def test_touchdowns_are_matched_within_a_fifth_of_a_second():
    reference, rollout = (np.zeros((100, 2), dtype=bool) for _ in range(2))
    reference[20:40, 0], rollout[23:40, 0] = True, True  # 60 ms later
    reference[60:80, 0], rollout[58:80, 0] = True, True  # 40 ms earlier
    reference[30:50, 1] = True  # never touches down
    rollout[70:90, 1] = True  # has no counterpart
    reference[:10, 1], rollout[:12, 1] = True, True  # stands from the start: no touchdown
    assert touchdown_shifts(reference, rollout, 50.0) == pytest.approx([0.06, -0.04])


def test_the_picture_needs_no_figure_to_be_there():
    nothing = dict.fromkeys(("slip_before_m_s", "slip_after_m_s", "saturated_after", "touchdown_shift_s"))
    some = {"penetration_before_m": 0.0, "penetration_after_m": 0.01, "jerk_before_rad_s3": 1.0}
    row = {**nothing, **some, "jerk_after_rad_s3": 2.0, "clip": "walk", "skill": "walk"}
    assert before_and_after(pd.DataFrame([row])).startswith(b"\x89PNG")


def test_a_rollout_that_moves_at_another_speed_has_its_drift(robot: Robot):
    """The tracking errors see nothing of it: they are measured at the robot's own place."""
    still = standing(robot, seconds=2.0)
    time_s = np.arange(still.frame_count) / still.fps
    sway = 0.03 * np.sin(2.0 * np.pi * 2.0 * time_s)  # one period a chord
    reference, rollout = (
        dataclasses.replace(still, root_pos_w=still.root_pos_w + np.stack([v * time_s, sway, 0 * sway], axis=1))
        for v in (1.5, 1.0)
    )
    found = before_after(reference, rollout, robot)
    assert found["speed_before_m_s"] == pytest.approx(1.5, abs=1e-6)
    assert found["speed_after_m_s"] == pytest.approx(1.0, abs=1e-6)
    assert found["drift_m"] == pytest.approx(0.5 * time_s[-1])
    assert path_speed(still.root_pos_w[:1], still.fps) == 0.0
    table = by_skill(pd.DataFrame([{**found, "skill": "run"}, {**found, "speed_after_m_s": 2.0, "skill": "run"}]))
    assert table.to_dict("records")[0] == {
        "skill": "run",
        "references": 2,
        "speed_before_m_s": pytest.approx(1.5),
        "speed_after_m_s": pytest.approx(1.5),
        "drift_m": pytest.approx(found["drift_m"]),
    }
