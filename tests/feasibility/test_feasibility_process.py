"""What goes on and what doesn't: cuts, names, reasons, and that what leaves satisfies the stage by itself."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.augment.mirror import time_scale_clip
from pipeline.clips.robot_clip import RobotClip
from pipeline.errors import ClipError
from pipeline.feasibility import FeasibilitySettings, assess, process
from pipeline.feasibility.motion import at_database_rate, motion_of
from pipeline.robot import Robot
from tests.factories.policy_walks import policy_walk
from tests.factories.robot_clips import standing, wandering
from tests.factories.robot_faults import FAULTS


def _bent(clip: RobotClip, robot: Robot, start: int, stop: int) -> RobotClip:
    """An arm joint .2 rad past its limit in frames [start, stop), led there and back slowly."""
    joint = robot.joint("Left_Elbow_Yaw")
    level = np.interp(np.arange(clip.frame_count), [start - 25, start, stop - 1, stop + 24], [0.0, 1.0, 1.0, 0.0])
    joints = clip.joint_pos.copy()
    joints[:, joint] += level * (robot.joint_upper[joint] + 0.2 - joints[:, joint])
    return dataclasses.replace(clip, joint_pos=joints)


def test_a_good_clip_goes_on_whole_under_its_name(robot: Robot, limits: FeasibilitySettings):
    outcome = process(standing(robot), {"skill": "stand", "forward_m_s": 9.0}, settings=limits, robot=robot)
    assert [piece.clip.name for piece in outcome.pieces] == ["test/stand"]
    assert outcome.reasons == ()
    numbers = outcome.pieces[0].numbers
    assert numbers["skill"] == "stand"
    assert numbers["forward_m_s"] == pytest.approx(0.0)  # the robot's own speed, not the human's
    assert numbers["seconds"] == pytest.approx(2.0)


def test_a_bad_stretch_is_cut_out_and_the_rest_goes_on(robot: Robot, limits: FeasibilitySettings):
    clip = _bent(standing(robot, 6.0), robot, 140, 160)
    outcome = process(clip, {}, settings=limits, robot=robot)
    assert [piece.clip.name for piece in outcome.pieces] == ["test/stand+0", "test/stand+1"]
    first, second = (piece.clip for piece in outcome.pieces)
    assert isinstance(first, RobotClip)
    assert isinstance(second, RobotClip)
    assert 110 <= first.frame_count <= 140
    assert 100 <= second.frame_count <= 140
    np.testing.assert_array_equal(first.joint_pos, clip.joint_pos[: first.frame_count])
    np.testing.assert_array_equal(second.joint_pos, clip.joint_pos[-second.frame_count :])
    for piece in outcome.pieces:  # each says where it lies in the input
        start, stop = (round(50.0 * float(piece.numbers[f"stretch_{end}_s"] or 0.0)) for end in ("start", "stop"))
        np.testing.assert_array_equal(piece.clip.root_pos_w, clip.root_pos_w[start:stop])
    reason = next(reason for reason in outcome.reasons if reason.code == "joint_limit_excess")
    assert reason.start_s == pytest.approx(2.7, abs=0.15)
    assert reason.stop_s == pytest.approx(3.3, abs=0.15)
    assert outcome.numbers["kept_seconds"] == pytest.approx((first.frame_count + second.frame_count) / 50.0)


def test_what_is_left_too_short_does_not_go_on(robot: Robot, limits: FeasibilitySettings):
    outcome = process(_bent(standing(robot, 1.2), robot, 20, 40), {}, settings=limits, robot=robot)
    assert outcome.pieces == ()
    assert {reason.effect for reason in outcome.reasons} == {"rejected"}


def test_a_clip_that_is_too_short_says_so(robot: Robot, limits: FeasibilitySettings):
    outcome = process(standing(robot, 0.38), {}, settings=limits, robot=robot)
    assert [reason.code for reason in outcome.reasons] == ["too_short"]


@pytest.mark.parametrize("fps", [30.0, 50.0, 60.0, 120.0])
@pytest.mark.parametrize("scale", [0.9, 1.0, 1.1])
def test_the_shortest_window_goes_on_at_any_rate_and_speed(
    robot: Robot, limits: FeasibilitySettings, fps: float, scale: float
):
    window = time_scale_clip(at_database_rate(standing(robot, 0.5, fps)), scale, "test/stand")
    outcome = process(window, {}, settings=limits, robot=robot)
    assert [piece.clip.frame_count for piece in outcome.pieces] == [window.frame_count]


def test_a_single_bad_frame_weighs_no_more_in_a_short_clip_than_in_a_long_one(
    robot: Robot, limits: FeasibilitySettings
):
    sunk = np.zeros((25, 3))
    sunk[12, 2] = -0.015  # past the limit of the 95th percentile, within that of the deepest frame
    clip = standing(robot, 0.5)
    found = process(dataclasses.replace(clip, root_pos_w=clip.root_pos_w + sunk), {}, settings=limits, robot=robot)
    values = {code: float(found.numbers[code] or 0.0) for code in ("penetration_p95", "penetration_max")}
    assert values["penetration_p95"] < limits.feet.penetration_p95 < values["penetration_max"]


def test_a_loosened_threshold_lets_more_through(robot: Robot, limits: FeasibilitySettings):
    loose = dataclasses.replace(limits, joints=dataclasses.replace(limits.joints, limit_excess=0.3))
    clip = _bent(standing(robot, 6.0), robot, 140, 160)
    assert len(process(clip, {}, settings=loose, robot=robot).pieces) == 1


@pytest.mark.parametrize("fps", [50.0, 100.0, 500.0, 60.0])
def test_clips_of_other_rates_come_out_at_50_hz(robot: Robot, limits: FeasibilitySettings, fps: float):
    clip = standing(robot, 2.0, fps)
    times_s = np.arange(clip.frame_count) / fps
    nod = clip.joint_pos.copy()
    nod[:, robot.joint("Head_pitch")] = 0.2 * np.sin(3.0 * times_s)
    at_rate = at_database_rate(dataclasses.replace(clip, joint_pos=nod))
    assert at_rate.fps == 50.0
    wanted = 0.2 * np.sin(3.0 * np.arange(at_rate.frame_count) / 50.0)
    np.testing.assert_allclose(at_rate.joint_pos[:, robot.joint("Head_pitch")], wanted, atol=1e-5)
    assert process(dataclasses.replace(clip, joint_pos=nod), {}, settings=limits, robot=robot).pieces


def test_a_clip_of_another_robot_or_with_missing_numbers_is_refused(robot: Robot, limits: FeasibilitySettings):
    clip = standing(robot)
    with pytest.raises(ClipError, match="joints are not those"):
        process(dataclasses.replace(clip, joint_names=clip.joint_names[::-1]), {}, settings=limits, robot=robot)
    holes = clip.joint_pos.copy()
    holes[7, 3] = np.nan
    with pytest.raises(ClipError, match="frame 7: joint_pos"):
        process(dataclasses.replace(clip, joint_pos=holes), {}, settings=limits, robot=robot)


WALKS = (
    (-0.6, 0.0, 0.0),
    (0.6, 0.0, 0.0),
    (1.4, 0.0, 0.0),
    (2.0, 0.0, 0.0),
    (0.0, 0.6, 0.0),
    (0.0, 0.0, -1.5),
    (0.9, 0.2, 0.6),
)


@pytest.mark.shared
@pytest.mark.parametrize("command", WALKS)
def test_a_policy_known_to_walk_is_accepted_whole(
    robot: Robot, limits: FeasibilitySettings, policies: Path, command: tuple[float, float, float]
):
    outcome = process(policy_walk(policies, robot, command, 5.0).clip("walk"), {}, settings=limits, robot=robot)
    assert [piece.clip.name for piece in outcome.pieces] == ["walk"], [reason.text for reason in outcome.reasons]


@pytest.mark.shared
@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_infeasibility_is_found_and_the_rest_satisfies_the_stage_by_itself(
    robot: Robot, limits: FeasibilitySettings, policies: Path, fault: str
):
    rng = np.random.default_rng(3)
    for command in ((1.6, 0.0, 0.0), (0.8, 0.2, -0.4)):
        if fault == "double speed" and command[0] < 1.5:
            continue
        clip = policy_walk(policies, robot, command, 6.0).clip("walk", start_s=1.0)
        outcome = process(FAULTS[fault](clip, robot, rng), {}, settings=limits, robot=robot)
        assert outcome.reasons, f"{fault} at {command} was not found"
        for piece in outcome.pieces:
            assert isinstance(piece.clip, RobotClip)
            assert assess(motion_of(piece.clip, robot, limits), limits).holds
            again = process(piece.clip, {}, settings=limits, robot=robot)
            assert [other.clip.name for other in again.pieces] == [piece.clip.name]


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_the_sign_of_quaternions_does_not_matter_at_another_rate(robot: Robot, fps: float):
    """q and -q are one rotation: a spline through both would pass through none."""
    clip = wandering(robot, seconds=2.0, fps=fps)
    flipped = clip.root_quat_w * np.where(np.arange(clip.frame_count) % 3 == 0, -1.0, 1.0)[:, None]
    found = at_database_rate(dataclasses.replace(clip, root_quat_w=flipped))
    fine = wandering(robot, seconds=2.0, fps=50.0)
    count = min(found.frame_count, fine.frame_count)
    inner = slice(3, count - 3)
    assert found.fps == 50.0 and count > 90
    assert rotation.angle_between(found.root_quat_w[inner], fine.root_quat_w[inner]).max() < 1e-4
