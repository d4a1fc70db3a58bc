"""The 79 numbers of a frame against differences, against MuJoCo and against what a circle must give."""

import dataclasses
import json

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import rotation
from pipeline.errors import ClipError
from pipeline.expert import columns, expert_frames
from pipeline.expert.frames import frames_of_clips, numbers_text, rounded
from pipeline.expert.write import loop_mode
from pipeline.robot import Robot, mujoco_model
from tests.factories.robot_clips import standing, wandering

POS, QUAT, JOINTS, ENDS = slice(0, 3), slice(3, 7), slice(7, 28), slice(28, 40)
LIN, ANG, JOINT_VEL, END_VEL = slice(40, 43), slice(43, 46), slice(46, 67), slice(67, 79)


def test_a_frame_has_79_named_columns_in_the_papers_order(robot: Robot):
    named = columns(robot)
    assert len(named) == 79
    assert len({column.name for column in named}) == 79
    assert [column.name for column in named[3:7]] == ["root_quat_w", "root_quat_x", "root_quat_y", "root_quat_z"]
    assert [column.name.removesuffix("_pos") for column in named[JOINTS]] == list(robot.controlled)
    assert [column.name for column in named[28:40:3]] == [
        "left_hand_x_pos",
        "right_hand_x_pos",
        "left_sole_centre_x_pos",
        "right_sole_centre_x_pos",
    ]
    assert {column.frame for column in named[LIN]} == {"Trunk"}
    assert expert_frames(wandering(robot), robot).shape == (100, 79)


def test_end_effectors_are_where_mujoco_has_their_sites(robot: Robot):
    clip = wandering(robot)
    frames = expert_frames(clip, robot)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    for frame in (0, 37, 99):
        data.qpos[:] = [*clip.root_pos_w[frame], *clip.root_quat_w[frame], *clip.joint_pos[frame]]
        mujoco.mj_kinematics(model, data)
        sites = [data.site(name).xpos for name in (*robot.hands, *robot.feet)]
        local = rotation.rotate_inverse(clip.root_quat_w[frame], np.array(sites) - clip.root_pos_w[frame])
        np.testing.assert_allclose(frames[frame, ENDS], local.ravel(), atol=1e-9)


def test_written_velocities_are_the_differences_of_the_written_positions(robot: Robot):
    frames = rounded(expert_frames(wandering(robot), robot), 21)
    inner = slice(1, -1)

    def difference(part: slice) -> np.ndarray:
        return (frames[2:, part] - frames[:-2, part]) * 25.0

    np.testing.assert_allclose(frames[inner, JOINT_VEL], difference(JOINTS), atol=6e-5)
    np.testing.assert_allclose(frames[inner, END_VEL], difference(ENDS), atol=6e-5)
    quat = frames[inner, QUAT]
    np.testing.assert_allclose(rotation.rotate(quat, frames[inner, LIN]), difference(POS), atol=1e-4)
    step = rotation.multiply(frames[2:, QUAT], rotation.conjugate(frames[:-2, QUAT]))
    np.testing.assert_allclose(rotation.rotate(quat, frames[inner, ANG]), rotation.to_rotvec(step) * 25.0, atol=1e-4)


def test_walking_on_a_circle_has_constant_velocity_in_the_trunk_frame(robot: Robot):
    clip = standing(robot, 4.0)
    yaw = 0.8 * np.arange(clip.frame_count) / 50.0
    circle = np.stack([np.sin(yaw), -np.cos(yaw), 0.0 * yaw + 0.7], axis=1)
    frames = expert_frames(dataclasses.replace(clip, root_pos_w=circle, root_quat_w=rotation.about_z(yaw)), robot)
    np.testing.assert_allclose(frames[1:-1, LIN], np.tile([0.8, 0.0, 0.0], (198, 1)), atol=1e-4)
    np.testing.assert_allclose(frames[:, ANG], np.tile([0.0, 0.0, 0.8], (200, 1)), atol=1e-9)
    np.testing.assert_allclose(frames[:, END_VEL], 0.0, atol=1e-9)


def test_rounded_quaternions_stay_unit(robot: Robot):
    frames = rounded(expert_frames(wandering(robot), robot), 21)
    np.testing.assert_allclose(np.linalg.norm(frames[:, QUAT], axis=1), 1.0, atol=1e-7)


def test_a_stand_wraps_and_a_motion_that_ends_elsewhere_does_not(robot: Robot):
    assert loop_mode(standing(robot)) == "Wrap"
    assert loop_mode(wandering(robot)) == "Clamp"


def test_a_clip_of_another_rate_or_robot_or_of_one_frame_is_refused(robot: Robot):
    clip = standing(robot)
    with pytest.raises(ClipError, match="has 100 Hz"):
        expert_frames(dataclasses.replace(clip, fps=100.0), robot)
    with pytest.raises(ClipError, match="joints are not those"):
        expert_frames(dataclasses.replace(clip, joint_names=clip.joint_names[::-1]), robot)
    with pytest.raises(ClipError, match="less than two frames"):
        expert_frames(clip.cut(0, 1, "one"), robot)


DECIMAL = st.builds(lambda number, digits: number / 10**digits, st.integers(-(10**12), 10**12), st.integers(0, 8))
SMALL = st.builds(lambda number, digits: number / 10**digits, st.integers(-20_000, 20_000), st.integers(4, 8))
"""Numbers that Python writes with an exponent, and those next to them."""


@given(st.lists(st.tuples(DECIMAL, SMALL, SMALL), min_size=1, max_size=40))
def test_the_text_of_frames_is_that_of_pythons_json(frames):
    wanted = ",\n".join(json.dumps(frame, separators=(",", ":")) for frame in frames)
    assert numbers_text(np.array(frames)) == wanted.encode()


def test_all_small_numbers_are_written_as_python_writes_them():
    frames = np.arange(1, 20_000)[:, None] / [1e5, 1e6, 1e8] * [1.0, -1.0, 1.0]
    wanted = ",\n".join(json.dumps(frame, separators=(",", ":")) for frame in frames.tolist())
    assert numbers_text(frames) == wanted.encode()


def test_a_number_that_is_not_finite_is_not_written():
    with pytest.raises(ValueError, match="not finite"):
        numbers_text(np.array([[0.0, np.nan]]))


@pytest.mark.parametrize("number", [1e16, -2e16])
def test_a_number_that_needs_a_positive_exponent_is_not_written(number: float):
    with pytest.raises(ValueError, match=r"has a size of 1e\+16 or more"):
        numbers_text(np.array([[0.0, number]]))
    below = np.nextafter(1e16, 0.0)
    assert json.loads(numbers_text(np.array([[0.0, below]]))) == [0.0, below]


def test_frames_of_several_clips_have_the_bits_of_each_alone(robot: Robot):
    clips = [wandering(robot), standing(robot, 0.5), wandering(robot, 1.3)]
    for clip, frames in zip(clips, frames_of_clips(clips, robot), strict=True):
        np.testing.assert_array_equal(frames, expert_frames(clip, robot))
