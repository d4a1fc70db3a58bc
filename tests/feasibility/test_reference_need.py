"""What a reference asks of the motors: which joints may be asked for more, and that a weak motor does not hide at the
root, where what the reference lacks is missing anyway."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.feasibility import FeasibilitySettings, Verdict
from pipeline.feasibility.motion import motion_of
from pipeline.feasibility.reference_need import allowed_need, lasting_need_over_allowed, need_over_allowed
from pipeline.feasibility.torque_criteria import Contacts, dynamics
from pipeline.files import settings
from pipeline.quality.sole import sole_motion
from pipeline.robot import Robot, mujoco_model
from tests.factories.robot_clips import standing

LEAN = 0.02
"""To the left [rad]: the mass stays inside of the left foot, so that no force on it explains the pose."""
GRAVITY = 9.81
LEVER = 0.1
"""What weighs moments against forces at the root [m]."""


@pytest.fixture(scope="module")
def limits(root: Path) -> FeasibilitySettings:
    return settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)


@pytest.mark.parametrize("speed", [0.0, 1.5])
def test_only_joints_that_shift_the_centre_of_pressure_may_be_asked_for_more_and_more_at_speed(robot, limits, speed):
    need = limits.torque.reference_need
    allowed = dict(zip(robot.joint_names, allowed_need(robot, speed, need), strict=True))
    for side in ("Left", "Right"):
        for name in ("Hip_Roll", "Ankle_Roll"):
            assert allowed[f"{side}_{name}"] == need.roll[0] + need.roll[1] * speed
        assert allowed[f"{side}_Ankle_Pitch"] == need.ankle[0] + need.ankle[1] * speed
        for name in ("Hip_Pitch", "Hip_Yaw", "Knee_Pitch", "Shoulder_Roll"):
            assert allowed[f"{side}_{name}"] == need.motor[0] + need.motor[1] * speed


def test_a_need_counts_by_how_long_it_lasts_without_a_break(robot, limits):
    motion = motion_of(standing(robot, 2.0), robot, limits)
    need, knee = limits.torque.reference_need, robot.joint("Right_Knee_Pitch")
    ratio = np.zeros((motion.clip.frame_count, len(robot.joint_names)))
    ratio[10:14, knee], ratio[20:24, knee] = 20.0, 20.0
    short = need_over_allowed(motion, ratio, need)
    assert short.value == pytest.approx(0.08)
    assert short.holds
    ratio[40:45, knee] = 1.01 * need.motor[0]
    long = need_over_allowed(motion, ratio, need)
    assert long.value == pytest.approx(0.1)
    assert not long.holds
    assert long.bad is not None
    assert np.flatnonzero(long.bad).tolist() == list(range(40, 45))
    assert "from 0.80 s on" in long.text
    assert "Right_Knee_Pitch for 1.21 times" in long.text


def _out_of_balance(robot: Robot) -> RobotClip:
    """On the left foot, which stays flat, with the mass of the robot inside of it."""
    clip = standing(robot, 2.0)
    joints = clip.joint_pos.copy()
    joints[:, robot.joint("Left_Ankle_Roll")] += LEAN
    tilt = rotation.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.full(clip.frame_count, -LEAN))
    contacts = np.tile(np.array([True, False]), (clip.frame_count, 1))
    leaning = dataclasses.replace(clip, joint_pos=joints, root_quat_w=tilt, contacts=contacts)
    height = sole_motion(leaning, robot).height
    return dataclasses.replace(leaning, root_pos_w=leaning.root_pos_w - np.array([0.0, 0.0, height[0, 0]]))


def _hip_need(robot: Robot) -> float:
    """Moment about the left hip's roll axis [N m] of the ground's force and of the leg's own weight.

    The force acts at the inner edge of the sole, straight up. It bears what leaves least at the root: with the edge at
    e and the mass at c beside the root, of a weight W, min over f of (W - f)^2 + ((W c - f e) / LEVER)^2.
    """
    clip, model = _out_of_balance(robot), mujoco_model(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = np.concatenate([clip.root_pos_w[0], clip.root_quat_w[0], clip.joint_pos[0]])
    mujoco.mj_forward(model, data)
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "Left_Hip_Roll")
    leg = {int(model.jnt_bodyid[joint])}
    for body in range(model.nbody):
        if int(model.body_parentid[body]) in leg:
            leg.add(body)
    corners = sole_motion(clip, robot).corner_pos_w[0, 0]
    edge = corners[corners[:, 1] < corners[:, 1].mean()].mean(axis=0)
    beside, mass = edge[1] - data.qpos[1], data.subtree_com[1, 1] - data.qpos[1]
    borne = (1.0 + beside * mass / LEVER**2) / (1.0 + beside**2 / LEVER**2)
    assert borne < 0.95, "the edge of the sole is not below the mass"
    moment = np.cross(edge - data.xanchor[joint], [0.0, 0.0, borne * robot.total_mass * GRAVITY])
    for body in leg:
        moment += np.cross(data.xipos[body] - data.xanchor[joint], [0.0, 0.0, -model.body_mass[body] * GRAVITY])
    return abs(float(moment @ data.xaxis[joint]))


def _verdicts(robot: Robot, limits: FeasibilitySettings, hip_limit: float) -> dict[str, Verdict]:
    limit = robot.torque_limit.copy()
    limit[robot.joint("Left_Hip_Roll")] = hip_limit
    weak = dataclasses.replace(robot, torque_limit=limit)
    found = dynamics(motion_of(_out_of_balance(robot), weak, limits), limits.torque)
    assert not found.consistent
    return {verdict.code: verdict for verdict in found.verdicts}


def test_a_weak_hip_does_not_hide_at_the_root_of_a_motion_that_no_forces_explain(robot, limits):
    need, allowed = _hip_need(robot), limits.torque.reference_need.roll[0]
    enough, too_weak = (_verdicts(robot, limits, need / (part * allowed)) for part in (0.97, 1.03))
    assert enough["reference_need_run_s"].value == 0.0
    assert too_weak["reference_need_run_s"].value == pytest.approx(2.0)
    assert not too_weak["reference_need_run_s"].holds
    assert "Left_Hip_Roll" in too_weak["reference_need_run_s"].text
    limits_first = (too_weak["torque_over_run_s"], too_weak["torque_over_share"])
    assert all(verdict.holds for verdict in limits_first), "where limits come first, the root takes the need"


def test_a_motion_that_forces_explain_is_not_asked(robot, limits):
    found = dynamics(motion_of(standing(robot, 2.0), robot, limits), limits.torque)
    assert found.consistent
    assert "reference_need_run_s" not in {verdict.code for verdict in found.verdicts}


def test_a_need_that_lasts_is_that_of_one_motor_where_the_others_keep_to_their_limits(robot, limits):
    need, allowed = _hip_need(robot), limits.torque.lasting_need.roll[0]
    enough, too_weak = (_verdicts(robot, limits, need / (part * allowed)) for part in (0.97, 1.03))
    assert enough["reference_lasting_need"].value == pytest.approx(0.97, abs=0.005)
    assert enough["reference_lasting_need"].holds
    assert too_weak["reference_lasting_need"].value == pytest.approx(1.03, abs=0.005)
    assert not too_weak["reference_lasting_need"].holds
    assert too_weak["reference_lasting_need"].bad.all()
    assert "Left_Hip_Roll for 1.44 times" in too_weak["reference_lasting_need"].text


def test_where_an_ankle_is_at_its_limit_the_hip_is_asked_for_what_it_would_give_in_its_place(robot, limits):
    """Forces at the edge of the sole ask the ankle too; where it can't give that, they lie further inside."""
    clip, ankle, hip = _out_of_balance(robot), robot.joint("Left_Ankle_Roll"), robot.joint("Left_Hip_Roll")
    limit = robot.torque_limit.copy()
    limit[[ankle, hip]] = 5.0, 0.5 * _hip_need(robot)
    weak = dataclasses.replace(robot, torque_limit=limit)
    contacts = Contacts(motion_of(clip, weak, limits), limits.torque, (0.02, 0.02))
    weight = limits.torque.reference_excess
    first = contacts.solve(weight)
    alone = contacts.torque_alone(first, weight)
    np.testing.assert_allclose(np.abs(first.joint_torque[:, hip]), limit[hip], rtol=0.01)
    limit[hip] = 100.0
    np.testing.assert_allclose(
        alone[:, hip], contacts.solve(weight, torque_limit=limit).joint_torque[:, hip], rtol=1e-3
    )
    assert np.abs(alone[0, hip]) > 1.5 * 0.5 * _hip_need(robot)
    within = np.abs(first.joint_torque) < 0.98 * robot.torque_limit
    within[:, [ankle, hip]] = False
    np.testing.assert_array_equal(alone[within], first.joint_torque[within])


def test_what_a_motor_may_be_asked_for_follows_the_speed_at_that_time(robot, limits):
    clip, need = standing(robot, 4.0), limits.torque.lasting_need
    times_s = np.minimum(np.arange(200) / 50.0, 2.0)  # it goes at 1 m/s and then stops
    motion = motion_of(
        dataclasses.replace(clip, root_pos_w=clip.root_pos_w + times_s[:, None] * [1.0, 0.0, 0.0]), robot, limits
    )
    ankle, ratio = robot.joint("Left_Ankle_Pitch"), np.zeros((200, len(robot.joint_names)))
    asked = 0.97 * (need.ankle[0] + need.ankle[1])
    ratio[50, ankle] = asked
    assert lasting_need_over_allowed(motion, ratio, need).value == pytest.approx(0.97)
    ratio[120, ankle] = asked
    stopped = lasting_need_over_allowed(motion, ratio, need)
    assert stopped.value == pytest.approx(asked / need.ankle[0])
    assert stopped.bad is not None
    assert np.flatnonzero(stopped.bad).tolist() == [120]
    assert "around 2.40 s" in stopped.text
    longer = dataclasses.replace(need, speed_s=2.0)  # a third of which it went
    assert lasting_need_over_allowed(motion, ratio, longer).value < 0.9 * stopped.value
