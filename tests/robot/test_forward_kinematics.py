"""Forward kinematics: many links and frames at once have the bits of one after the other."""

import numpy as np
import pytest

from pipeline import rotation
from pipeline.project import PROJECT
from pipeline.robot.robot import FRAMES_AT_A_TIME, Robot, Tree, forward


def _poses(robot: Robot, frames: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    joint_pos = rng.normal(size=(frames, len(robot.joint_names)))
    return rng.normal(size=(frames, 3)), rotation.normalize(rng.normal(size=(frames, 4))), joint_pos


@pytest.mark.parametrize("name", PROJECT.robots)
def test_links_have_the_bits_of_their_chain(name):
    robot = PROJECT.robot(name)
    tree, (root_pos_w, root_quat_w, joint_pos) = robot.tree, _poses(robot, 7)
    pos_w, quat_w = forward(tree, root_pos_w, root_quat_w, joint_pos)
    for link in range(len(tree.parent)):
        pos, quat = root_pos_w, root_quat_w
        for each in reversed(tree.chain(link)):
            turn = rotation.from_axis_angle(tree.axis[each], joint_pos[:, tree.joint[each]])
            pos = pos + rotation.rotate(quat, tree.pos[each])
            quat = rotation.multiply(quat, rotation.multiply(tree.quat[each], turn))
        assert pos_w[:, link].tobytes() == pos.tobytes()
        assert quat_w[:, link].tobytes() == quat.tobytes()


@pytest.mark.parametrize("frames", [0, 1, FRAMES_AT_A_TIME, FRAMES_AT_A_TIME + 1, 3 * FRAMES_AT_A_TIME - 1])
def test_frames_do_not_depend_on_how_many_there_are(frames):
    robot = PROJECT.robot("t1")
    poses = _poses(robot, frames)
    found = forward(robot.tree, *poses)
    assert [each.shape for each in found] == [(frames, len(robot.link_names), parts) for parts in (3, 4)]
    alone = [forward(robot.tree, *(each[frame : frame + 1] for each in poses)) for frame in range(frames)]
    for own, parts in zip(found, zip(*alone, strict=True), strict=False):
        assert own.tobytes() == np.concatenate(parts).tobytes()


def test_a_tree_of_one_link_is_its_root():
    none = np.zeros((1, 0))
    tree = Tree(
        link_names=("Trunk",),
        site_names=(),
        site_link=np.zeros(0, dtype=int),
        site_pos=np.zeros((0, 3)),
        parent=np.array([-1]),
        joint=np.array([-1]),
        axis=np.zeros((1, 3)),
        pos=np.zeros((1, 3)),
        quat=np.array([[1.0, 0.0, 0.0, 0.0]]),
    )
    pos_w, quat_w = forward(tree, np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 1.0, 0.0, 0.0]]), none)
    assert pos_w.tolist() == [[[1.0, 2.0, 3.0]]] and quat_w.tolist() == [[[0.0, 1.0, 0.0, 0.0]]]
