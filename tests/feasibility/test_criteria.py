"""Each criterion against a fault of known size in a motion that is otherwise fine."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import Assessment, FeasibilitySettings, assess
from pipeline.feasibility.motion import motion_of
from pipeline.files import settings
from pipeline.robot import Robot
from tests.factories.robot_clips import standing


@pytest.fixture(scope="module")
def limits(root: Path) -> FeasibilitySettings:
    return settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)


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
