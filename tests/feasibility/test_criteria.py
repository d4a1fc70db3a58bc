"""Each criterion against a fault of known size in a motion that is otherwise fine."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import Assessment, FeasibilitySettings, Verdict, assess
from pipeline.feasibility.foot_criteria import _sliding_stances
from pipeline.feasibility.motion import motion_of
from pipeline.robot import Robot
from tests.factories.robot_clips import standing


def _assess(clip: RobotClip, robot: Robot, limits: FeasibilitySettings) -> Assessment:
    return assess(motion_of(clip, robot, limits), limits)


def _moved(clip: RobotClip, path: np.ndarray) -> RobotClip:
    return dataclasses.replace(clip, root_pos_w=clip.root_pos_w + path)


def _joint(clip: RobotClip, robot: Robot, name: str, values: np.ndarray | float) -> RobotClip:
    joints = clip.joint_pos.copy()
    joints[:, robot.joint(name)] = values
    return dataclasses.replace(clip, joint_pos=joints)


def test_a_robot_that_stands_satisfies_every_criterion(robot: Robot, limits: FeasibilitySettings):
    found = _assess(standing(robot), robot, limits)
    assert found.holds, [verdict.text for verdict in found.broken]
    assert len(found.verdicts) == len({verdict.code for verdict in found.verdicts}) >= 22


def test_numbers_name_every_criterion_and_the_command(robot: Robot, limits: FeasibilitySettings):
    found = _assess(standing(robot), robot, limits)
    assert set(found.numbers) == {verdict.code for verdict in found.verdicts} | {
        "forward_m_s",
        "lateral_m_s",
        "yaw_rate_rad_s",
        *TEXTS,
    }
    assert all(np.isfinite(value) for code, value in found.numbers.items() if code not in TEXTS)


TEXTS = {"command_seconds", "gait_signature"}


def _past_limit(clip: RobotClip, robot: Robot) -> RobotClip:
    return _joint(clip, robot, "Left_Elbow_Yaw", robot.joint_upper[robot.joint("Left_Elbow_Yaw")] + 0.1)


def _fast(clip: RobotClip, robot: Robot) -> RobotClip:
    return _joint(clip, robot, "Left_Shoulder_Pitch", 10.0 * np.arange(100) / 50.0)


def _sunk(clip: RobotClip, robot: Robot) -> RobotClip:
    return _moved(clip, np.array([0.0, 0.0, -0.05]))


def _hovering(clip: RobotClip, robot: Robot) -> RobotClip:
    return _moved(clip, np.array([0.0, 0.0, 0.05]))


def _skating(clip: RobotClip, robot: Robot) -> RobotClip:
    """.3 m/s forward, then as fast back: the mean velocity is 0."""
    path = 0.3 * (1.0 - np.abs(np.arange(100) - 50.0) / 50.0)
    return _moved(clip, path[:, None] * [1.0, 0.0, 0.0])


def _jump(clip: RobotClip, robot: Robot) -> RobotClip:
    return _moved(clip, np.where(np.arange(100) < 50, 0.0, 0.1)[:, None] * [1.0, 0.0, 0.0])


def _lying(clip: RobotClip, robot: Robot) -> RobotClip:
    tilt = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.full(100, 1.2))
    return dataclasses.replace(clip, root_quat_w=tilt)


def _crossed(clip: RobotClip, robot: Robot) -> RobotClip:
    return _joint(_joint(clip, robot, "Left_Hip_Roll", -0.2), robot, "Right_Hip_Roll", 0.2)


@pytest.mark.parametrize(
    ("fault", "code", "value", "tolerance"),
    [
        (_past_limit, "joint_limit_excess", 0.1, 1e-9),
        (_fast, "joint_speed_ratio", 10.0 / 7.33, 1e-6),
        (_fast, "joint_speed_over_share", 1.0, 1e-9),
        (_fast, "joint_speed_over_run_s", 2.0, 1e-9),
        (_sunk, "penetration_max", 0.05, 2e-3),
        (_sunk, "penetration_p95", 0.05, 2e-3),
        (_hovering, "floating_contact", 0.05, 2e-3),
        (_hovering, "flight_s", 2.0, 1e-9),
        (_skating, "foot_slip_mean", 0.3, 0.01),
        (_jump, "root_speed", 2.5, 1.0),
        (_lying, "root_tilt_deg", np.degrees(1.2), 1e-6),
    ],
)
def test_a_fault_is_measured_by_its_criterion(
    robot: Robot,
    limits: FeasibilitySettings,
    fault: Callable[[RobotClip, Robot], RobotClip],
    code: str,
    value: float,
    tolerance: float,
):
    found = {verdict.code: verdict for verdict in _assess(fault(standing(robot), robot), robot, limits).verdicts}
    assert found[code].value == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize("labelled", [True, False])
def test_feet_that_skate_too_fast_to_be_in_contact_are_not_on_the_ground(robot, limits, labelled):
    clip = standing(robot)
    contacts = np.zeros((clip.frame_count, 2), dtype=bool) if labelled else None
    path = 1.5 * np.arange(clip.frame_count)[:, None] / clip.fps * [1.0, 0.0, 0.0]
    skating = dataclasses.replace(_moved(clip, path), contacts=contacts)
    found = {verdict.code: verdict for verdict in _assess(skating, robot, limits).verdicts}
    assert found["flight_s"].value == pytest.approx(2.0)
    assert not found["flight_s"].holds


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (_past_limit, "joint_limit_excess"),
        (_sunk, "penetration_max"),
        (_hovering, "flight_s"),
        (_hovering, "floating_contact"),
        (_skating, "foot_slip_mean"),
        (_jump, "root_acceleration"),
        (_lying, "root_tilt_deg"),
        (_crossed, "self_collision_depth"),
    ],
)
def test_a_fault_breaks_its_criterion_and_is_said(
    robot: Robot, limits: FeasibilitySettings, fault: Callable[[RobotClip, Robot], RobotClip], code: str
):
    found = _assess(fault(standing(robot), robot), robot, limits)
    broken = {verdict.code: verdict for verdict in found.broken}
    assert code in broken
    reason = broken[code].reason(50.0, 0.0, 2.0)
    assert reason.value == broken[code].value
    assert reason.limit == broken[code].limit
    assert reason.effect == "rejected"
    assert reason.text.endswith("is allowed.")


def test_all_reasons_are_given_not_the_first(robot: Robot, limits: FeasibilitySettings):
    found = _assess(_sunk(_past_limit(standing(robot), robot), robot), robot, limits)
    assert {"joint_limit_excess", "penetration_max", "penetration_p95"} <= {verdict.code for verdict in found.broken}


def test_verdicts_do_not_change_under_heading_and_place(robot: Robot, limits: FeasibilitySettings):
    clip = _skating(standing(robot), robot)
    turn = rotation.about_z(-2.1)
    moved = dataclasses.replace(
        clip,
        root_pos_w=rotation.rotate(turn, clip.root_pos_w) + np.array([4.0, 5.0, 0.0]),
        root_quat_w=rotation.multiply(turn, clip.root_quat_w),
    )
    here, there = _assess(clip, robot, limits).numbers, _assess(moved, robot, limits).numbers
    assert here["gait_signature"] == there["gait_signature"]
    for code in here.keys() - TEXTS:  # boxes of command_seconds have edges at 0, where rounding decides
        assert there[code] == pytest.approx(here[code], rel=1e-3, abs=1e-6), code


def _swings(clip: RobotClip, robot: Robot, frames: int) -> RobotClip:
    """An arm that turns at 1.15 times its motor's speed for so many frames, there and back, once."""
    speed = np.zeros(100)
    speed[20 : 20 + frames], speed[60 : 60 + frames] = 1.15 * 7.33, -1.15 * 7.33
    rest = robot.default_joint_pos[robot.joint("Left_Shoulder_Pitch")]
    return _joint(clip, robot, "Left_Shoulder_Pitch", rest + np.cumsum(speed) / 50.0 - 0.4)


@pytest.mark.parametrize(("frames", "broken"), [(3, set()), (8, {"joint_speed_over_run_s", "joint_speed_over_share"})])
def test_a_limb_may_pass_its_motors_speed_for_a_moment_and_not_longer(
    robot: Robot, limits: FeasibilitySettings, frames: int, broken: set[str]
):
    found = _assess(_swings(standing(robot), robot, frames), robot, limits)
    assert {verdict.code for verdict in found.broken if verdict.code.startswith("joint_speed")} == broken


def _verdicts(clip: RobotClip, robot: Robot, limits: FeasibilitySettings) -> dict[str, Verdict]:
    return {verdict.code: verdict for verdict in _assess(clip, robot, limits).verdicts}


@pytest.mark.parametrize("by", [-0.2, 0.0, 0.1])
def test_the_roots_height_is_a_share_of_that_of_a_robot_that_stands(robot, limits, by):
    raised = _moved(standing(robot), np.array([0.0, 0.0, by * robot.default_root_height]))
    found = _verdicts(raised, robot, limits)
    for code in ("root_height_min", "root_height_max"):
        assert found[code].value == pytest.approx(1.0 + by, abs=1e-6)


def test_the_limit_of_slip_grows_with_the_speed_over_ground(robot, limits):
    at_speed = {}
    for speed in (0.0, 0.3, 0.9):
        path = speed * np.arange(100)[:, None] / 50.0 * [0.6, 0.8, 0.0]
        at_speed[speed] = _verdicts(_moved(standing(robot), path), robot, limits)
    for code, (least, by_speed) in {
        "foot_slip_p95": limits.feet.slip_p95,
        "foot_slip_mean": limits.feet.slip_mean,
        "foot_inferred_slip_mean": limits.feet.inferred_slip_mean,
    }.items():
        first, second, third = (found[code].limit for found in at_speed.values())
        assert first == pytest.approx(least, abs=1e-6)
        assert second - first == pytest.approx(0.3 * by_speed, rel=0.02)
        assert third - second == pytest.approx(2.0 * (second - first), rel=0.02)


def test_a_stance_is_blamed_for_its_mean_slip_and_not_for_a_moment():
    slip, standing_feet = np.full((100, 2), 0.02), np.zeros((100, 2), dtype=bool)
    standing_feet[10:40, 0] = standing_feet[50:80, 1] = True
    slip[20, 0] = 0.5  # a moment: 0.036 m/s on average
    slip[50:80, 1] = 0.2
    assert np.flatnonzero(_sliding_stances(slip, standing_feet, 0.1)).tolist() == list(range(50, 80))


def test_frames_in_which_a_sole_is_two_centimetres_too_low_are_blamed(robot, limits):
    path = np.zeros((100, 3))
    path[30:70, 2] = -0.02
    found = _verdicts(_moved(standing(robot), path), robot, limits)
    assert found["penetration_max"].holds, "it is not deep"
    bad = found["penetration_p95"].bad
    assert not found["penetration_p95"].holds and bad is not None
    assert np.flatnonzero(bad).tolist() == list(range(30, 70))


def test_legs_that_touch_by_a_centimetre_count_for_the_share_alone(robot, limits):
    """The hips close until the legs overlap by about a centimetre, in the first 40 of 100 frames."""
    for roll in np.arange(0.02, 0.3, 0.005):
        closed = np.where(np.arange(100) < 40, roll, 0.0)
        legs = _joint(_joint(standing(robot), robot, "Left_Hip_Roll", -closed), robot, "Right_Hip_Roll", closed)
        found = _verdicts(legs, robot, limits)
        if found["self_collision_depth"].value > 0.008:
            break
    assert found["self_collision_depth"].value < 0.018 and found["self_collision_depth"].holds
    assert found["self_collision_share"].value == pytest.approx(0.4)
