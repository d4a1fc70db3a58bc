"""Where the parts of a figure are, against MuJoCo and against joint positions that are known."""

import dataclasses

import mujoco
import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.human_clip import body
from pipeline.errors import ClipError
from pipeline.robot import load_robot, mujoco_model
from pipeline.viewing.human_figure import BONES, human_figure, mirrored
from pipeline.viewing.robot_figure import DRAWN_GROUP, robot_figure
from tests.factories.figures import gliding_human, standing_robot, tumbling_robot


def test_the_robots_primitives_are_where_mujoco_has_its_geoms(robot):
    clip = tumbling_robot(robot, frame_count=20)
    figure = robot_figure(clip, robot)
    model = mujoco_model(robot)
    data = mujoco.MjData(model)
    shapes = [shape for part in figure.parts for shape in part.shapes]
    index = [model.geom(shape.name).id for shape in shapes]
    assert sorted(index) == [geom for geom in range(model.ngeom) if model.geom_group[geom] == DRAWN_GROUP]
    for frame in range(clip.frame_count):
        data.qpos[:] = np.concatenate([clip.root_pos_w[frame], clip.root_quat_w[frame], clip.joint_pos[frame]])
        mujoco.mj_kinematics(model, data)
        pos, quat = figure.shape_poses(frame)
        assert np.abs(pos - data.geom_xpos[index]).max() < 1e-9
        matrices = data.geom_xmat[index].reshape(-1, 3, 3)
        assert np.abs(rotation.to_matrix(quat) - matrices).max() < 1e-9


def test_the_robots_primitives_have_the_sizes_of_mujocos_geoms(robot):
    model = mujoco_model(robot)
    for part in robot_figure(standing_robot(robot, frame_count=2), robot).parts:
        for shape in part.shapes:
            geom = model.geom(shape.name)
            assert f"mjGEOM_{shape.kind.upper()}" == mujoco.mjtGeom(int(geom.type[0])).name
            assert shape.size == tuple(geom.size[: len(shape.size)])


def test_the_soles_of_the_standing_robot_are_on_the_ground(robot):
    figure = robot_figure(standing_robot(robot, frame_count=2), robot)
    lowest = {}
    pos, quat = figure.shape_poses(0)
    index = 0
    for part in figure.parts:
        for shape in part.shapes:
            if part.foot is not None and shape.name.endswith("_foot_collision"):
                corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape.size
                lowest[part.foot] = (rotation.rotate(quat[index], corners) + pos[index])[:, 2].min()
            index += 1
    assert set(lowest) == {0, 1}
    assert all(abs(height) < 2e-3 for height in lowest.values())


def test_a_clip_of_other_joints_is_refused(robot):
    clip = standing_robot(robot, frame_count=2)
    other = dataclasses.replace(clip, joint_names=clip.joint_names[::-1])
    with pytest.raises(ClipError, match=r"its joints are not those of the robot 't1', in its order\.$"):
        robot_figure(other, robot)


def test_a_clip_of_another_robot_is_refused_with_the_option_that_shows_it(robot):
    with pytest.raises(ClipError, match=r"not those of the robot 't1', in its order\. .*: add --robot k1\.$"):
        robot_figure(standing_robot(load_robot("k1"), frame_count=2), robot)


def test_the_ends_of_a_humans_capsules_are_the_joints():
    clip = gliding_human(frame_count=5)
    figure = human_figure(clip)
    for (start, stop, _, _), part in zip(BONES, figure.parts, strict=False):
        index = figure.parts.index(part)
        half = np.array([0.0, 0.0, part.shapes[0].size[1]])
        for frame in range(clip.frame_count):
            ends = figure.pos_w[frame, index] + rotation.rotate(figure.quat_w[frame, index], np.stack([-half, half]))
            assert np.allclose(ends, [clip.body_pos_w[frame, body(start)], clip.body_pos_w[frame, body(stop)]])


def test_a_bone_that_points_straight_down_is_drawn():
    figure = human_figure(gliding_human(frame_count=2))
    shin = [part.name for part in figure.parts].index("left_knee-left_ankle")
    assert np.allclose(rotation.rotate(figure.quat_w[0, shin], np.array([0.0, 0, 1])), [0, 0, -1])
    assert figure.drawn(0).all()


def test_a_missing_joint_leaves_out_its_bones_in_its_frames_alone():
    clip = gliding_human(frame_count=5)
    pos = clip.body_pos_w.copy()
    pos[2, body("left_wrist")] = np.nan
    figure = human_figure(dataclasses.replace(clip, body_pos_w=pos))
    missing = [part.name for part, drawn in zip(figure.parts, figure.drawn(2), strict=True) if not drawn]
    assert missing == ["left_elbow-left_wrist"]
    assert figure.drawn(1).all() and figure.drawn(3).all()


@pytest.mark.parametrize(
    ("joint", "told"), [("right_knee", "no frame with right hip and knee"), ("left_ankle", "with left knee and ankle")]
)
def test_a_clip_without_a_leg_names_the_side_and_the_bone(joint: str, told: str):
    clip = gliding_human(frame_count=3)
    pos = clip.body_pos_w.copy()
    pos[:, body(joint)] = np.nan
    with pytest.raises(ClipError, match=told):
        human_figure(dataclasses.replace(clip, body_pos_w=pos))


def test_thigh_and_shank_may_be_recorded_in_different_frames():
    clip = gliding_human(frame_count=4)
    pos = clip.body_pos_w.copy()
    pos[:2, body("left_hip")] = pos[2:, body("left_ankle")] = np.nan
    figure = human_figure(dataclasses.replace(clip, body_pos_w=pos))
    for part, whole in zip(figure.parts, human_figure(clip).parts, strict=True):
        assert part.shapes[0].size == pytest.approx(whole.shapes[0].size)


def test_the_mirror_swaps_the_sides_and_mirrored_twice_is_the_clip_itself():
    clip = gliding_human(frame_count=3)
    pos = clip.body_pos_w.copy()
    pos[:, body("left_wrist")] = [0.4, 0.5, 1.3]
    clip = dataclasses.replace(clip, body_pos_w=pos)
    image = mirrored(clip)
    assert np.allclose(image.pos("right_wrist"), [0.4, -0.5, 1.3])
    assert image.contacts is not None and not image.contacts[1, 1] and image.contacts[1, 0]
    again = mirrored(image)
    assert np.array_equal(again.body_pos_w, clip.body_pos_w) and np.array_equal(again.contacts, clip.contacts)


def test_times_beyond_the_ends_show_the_first_and_the_last_frame():
    figure = human_figure(gliding_human(frame_count=31, fps=30.0))
    assert figure.duration_s == pytest.approx(1.0)
    assert [figure.frame_at(time_s) for time_s in (-1.0, 0.0, 0.5, 1.0, 9.0)] == [0, 0, 15, 30, 30]
