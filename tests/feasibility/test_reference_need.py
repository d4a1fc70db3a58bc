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
from pipeline.feasibility.reference_need import allowed_need, need_over_allowed
from pipeline.feasibility.torque_criteria import dynamics
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
