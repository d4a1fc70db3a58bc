"""Criteria of recorded forces: motors at their torque limits, and whether contacts explain the motion."""

import dataclasses

import mujoco
import numpy as np
import pytest

from pipeline.clips.robot_clip import RobotClip, SimulatedForces
from pipeline.feasibility import FeasibilitySettings, Verdict, assess, process
from pipeline.feasibility.judgement import NUMBER, from_text
from pipeline.feasibility.motion import motion_of
from pipeline.feasibility.torque_criteria import CODES as FORCES
from pipeline.feasibility.torque_criteria import centre_of_mass, recorded_forces, unexplained_force
from pipeline.physics import GRAVITY
from pipeline.robot import Robot, mujoco_model
from tests.factories.robot_clips import standing, wandering
from tests.factories.simulated_clip import simulated_standing

PUSH_N = 8.0
INFERRED = ("foot_inferred_slip_mean", "contact_disagreement", "foot_glide_s")


@pytest.fixture(scope="module")
def clip(robot: Robot) -> RobotClip:
    return simulated_standing(robot)


@pytest.fixture(scope="module")
def pushed(robot: Robot) -> RobotClip:
    return simulated_standing(robot, push_w=(PUSH_N, 0.0, 0.0))


def _verdicts(clip: RobotClip, robot: Robot, limits: FeasibilitySettings) -> dict[str, Verdict]:
    found = recorded_forces(motion_of(clip, robot, limits), limits.torque)
    return {verdict.code: verdict for verdict in found}


def _with(clip: RobotClip, **forces: np.ndarray) -> RobotClip:
    assert clip.forces is not None
    return dataclasses.replace(clip, forces=dataclasses.replace(clip.forces, **forces))


def _saturated(clip: RobotClip, robot: Robot, joint: str, frames: slice, ratio: float = 1.0) -> RobotClip:
    """The clip with a motor at its torque limit, in turning back as well as forth."""
    assert clip.forces is not None
    torque, index = clip.forces.joint_torque.copy(), robot.joint(joint)
    torque[frames, index] = -ratio * robot.torque_limit[index]
    return _with(clip, joint_torque=torque)


def test_the_recorded_contacts_of_a_robot_that_stands_explain_its_motion(robot, limits, clip):
    found = _verdicts(clip, robot, limits)
    assert set(found) == set(FORCES)
    assert all(verdict.holds for verdict in found.values())
    assert found["force_residual"].value < 0.01
    assert found["torque_saturation_share"].value == found["torque_saturation_run_s"].value == 0.0


def test_without_its_contact_forces_all_of_the_weight_is_missing(robot, limits, clip):
    found = _verdicts(_with(clip, foot_wrench_w=np.zeros((clip.frame_count, 2, 6))), robot, limits)["force_residual"]
    assert found.value == pytest.approx(1.0, abs=0.01)
    assert not found.holds
    assert found.bad is not None
    assert found.bad.all()
    assert "100 % of the weight is missing" in found.text


def test_frames_without_contact_forces_are_blamed_and_those_far_from_them_are_not(robot, limits, clip):
    assert clip.forces is not None
    wrench = clip.forces.foot_wrench_w.copy()
    wrench[60:80] = 0.0
    bad = _verdicts(_with(clip, foot_wrench_w=wrench), robot, limits)["force_residual"].bad
    assert bad is not None
    assert bad[60:80].all()
    assert not bad[:40].any()


def test_a_push_that_is_recorded_is_explained_and_one_that_is_not_is_missing(robot, limits, pushed):
    assert _verdicts(pushed, robot, limits)["force_residual"].value < 0.01
    silent = _verdicts(_with(pushed, push_w=np.zeros((pushed.frame_count, 3))), robot, limits)["force_residual"]
    assert silent.value == pytest.approx(PUSH_N / (robot.total_mass * 9.81), abs=0.005)


def test_forces_of_the_ground_on_other_links_count_as_those_on_the_feet_do(robot, limits, clip):
    assert clip.forces is not None
    moved = _with(
        clip,
        foot_wrench_w=np.zeros((clip.frame_count, 2, 6)),
        other_force_w=clip.forces.foot_wrench_w[..., :3].sum(axis=1),
    )
    assert _verdicts(moved, robot, limits)["force_residual"].value < 0.01


@pytest.mark.parametrize(("joint", "frames"), [("Right_Knee_Pitch", 40), ("Left_Shoulder_Roll", 8)])
def test_saturation_is_found_at_its_joint_with_its_share_and_its_time(robot, limits, clip, joint, frames):
    found = _verdicts(_saturated(clip, robot, joint, slice(20, 20 + frames)), robot, limits)
    share, run = found["torque_saturation_share"], found["torque_saturation_run_s"]
    assert share.value == pytest.approx(frames / clip.frame_count)
    assert run.value == pytest.approx(frames / clip.fps)
    assert f"the motor of {joint} is at its torque limit" in share.text
    assert f"from 0.40 s on the motor of {joint}" in run.text
    for verdict, limit in ((share, limits.torque.saturation_share), (run, limits.torque.saturation_run_s)):
        assert verdict.holds == (verdict.value <= limit)
        assert verdict.bad is not None
        wrong = [] if verdict.holds else list(range(20, 20 + frames))
        assert np.flatnonzero(verdict.bad).tolist() == wrong


def test_a_motor_below_its_limit_is_not_saturated(robot, limits, clip):
    below = _saturated(clip, robot, "Right_Knee_Pitch", slice(0, 100), limits.torque.saturation - 0.01)
    assert _verdicts(below, robot, limits)["torque_saturation_share"].value == 0.0


def test_several_joints_that_are_saturated_in_turn_do_not_add_up(robot, limits, clip):
    first = _saturated(clip, robot, "Right_Knee_Pitch", slice(0, 20))
    both = _saturated(first, robot, "Left_Knee_Pitch", slice(20, 40))
    assert _verdicts(both, robot, limits)["torque_saturation_share"].value == pytest.approx(0.2)


def test_a_clip_without_forces_gets_no_verdict_on_them(robot, limits):
    outcome = process(standing(robot), {}, settings=limits, robot=robot)
    assert outcome.pieces
    assert not {*FORCES} & set(outcome.numbers)
    (judgement,) = from_text(str(outcome.numbers[NUMBER]))
    for code in FORCES:
        assert judgement.found[code].value is None
        assert judgement.found[code].not_applicable == "no simulation recorded its forces"


def test_of_a_rollout_no_contact_is_inferred(robot, limits, clip):
    outcome = process(clip, {}, settings=limits, robot=robot)
    assert outcome.pieces, [reason.text for reason in outcome.reasons]
    (judgement,) = from_text(str(outcome.numbers[NUMBER]))
    assert {judgement.found[code].not_applicable for code in INFERRED} == {"the contacts are the simulation's"}
    assert not set(INFERRED) & {verdict.code for verdict in assess(motion_of(clip, robot, limits), limits).verdicts}
    assert all(judgement.found[code].value is not None for code in (*FORCES[:2], "foot_slip_mean"))


def test_the_moments_in_which_a_motor_is_saturated_are_cut_out_and_the_forces_of_the_rest_go_on(robot, limits):
    clip = simulated_standing(robot, 4.0)
    too_long = round(limits.torque.saturation_run_s * clip.fps) + 1
    middle = slice(80, 80 + too_long)
    outcome = process(_saturated(clip, robot, "Right_Knee_Pitch", middle), {}, settings=limits, robot=robot)
    assert {reason.code for reason in outcome.reasons} == {"torque_saturation_run_s"}
    first, second = (piece.clip for piece in outcome.pieces)
    assert isinstance(first, RobotClip) and isinstance(second, RobotClip)
    assert first.forces is not None and second.forces is not None and clip.forces is not None
    np.testing.assert_array_equal(first.forces.joint_torque, clip.forces.joint_torque[: first.frame_count])
    np.testing.assert_array_equal(second.forces.foot_wrench_w, clip.forces.foot_wrench_w[-second.frame_count :])


def test_the_centre_of_mass_is_the_simulators(robot):
    clip, model = wandering(robot), mujoco_model(robot)
    found = centre_of_mass(robot, clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    data = mujoco.MjData(model)
    for frame in (0, 37, 99):
        data.qpos[:] = np.concatenate([clip.root_pos_w[frame], clip.root_quat_w[frame], clip.joint_pos[frame]])
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(found[frame], data.subtree_com[1], atol=1e-9)


def test_forces_that_change_in_flight_explain_the_path_of_the_robot(robot, limits):
    """Constant acceleration in each control step: a push begins in the flight, grows and ends."""
    clip, weight = standing(robot), robot.total_mass * GRAVITY
    push_w = np.zeros((clip.frame_count, 3))
    push_w[40:60, 0], push_w[50:55, 1] = 150.0, np.linspace(0.0, 300.0, 5)
    acceleration = push_w / robot.total_mass - [0.0, 0.0, GRAVITY]
    dt, velocity, path = 1.0 / clip.fps, np.zeros(3), [np.array([0.0, 0.0, 30.0])]
    for each in acceleration[:-1]:
        path.append(path[-1] + velocity * dt + 0.5 * each * dt**2)
        velocity = velocity + each * dt
    forces = SimulatedForces(
        joint_torque=np.zeros_like(clip.joint_pos),
        foot_wrench_w=np.zeros((clip.frame_count, 2, 6)),
        other_force_w=np.zeros((clip.frame_count, 3)),
        push_w=push_w,
    )
    flying = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + np.array(path), forces=forces)
    residual = unexplained_force(motion_of(flying, robot, limits), forces)
    assert np.linalg.norm(residual, axis=1).max() < 1e-6 * weight
