"""The metrics of retargeting, against cases with a known answer."""

import numpy as np
import pytest

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.quality import retargeting
from pipeline.robot import Kinematics, load_robot
from tests.factories.retarget_clips import person_of

ROBOT = load_robot("t1")
FPS = 50.0


def robot_clip(joint_pos: np.ndarray) -> RobotClip:
    frames = len(joint_pos)
    return RobotClip(
        name="robot",
        fps=FPS,
        robot="t1",
        joint_names=ROBOT.joint_names,
        root_pos_w=np.tile([0.0, 0.0, 0.7], (frames, 1)),
        root_quat_w=np.tile(rotation.IDENTITY, (frames, 1)),
        joint_pos=joint_pos,
    )


def posed(clip: RobotClip):
    return Kinematics(ROBOT).forward(clip.root_pos_w, clip.root_quat_w, clip.joint_pos)


@pytest.fixture
def still() -> RobotClip:
    return robot_clip(np.tile(ROBOT.default_joint_pos, (10, 1)))


def test_a_person_made_of_the_robot_has_no_error(still):
    human, poses = person_of(still, ROBOT, np.array([0.1, 0.0, -0.04])), posed(still)
    assert retargeting.limb_direction_error(human, poses, ROBOT).max() < 1e-7
    assert retargeting.trunk_orientation_error(human, poses, ROBOT).max() < 1e-7
    assert retargeting.pelvis_heading_error(human, poses, ROBOT).max() < 1e-7


def test_a_joint_turned_by_an_angle_shows_as_that_angle(still):
    human = person_of(still, ROBOT, np.array([0.1, 0.0, -0.04]))
    joint_pos = still.joint_pos.copy()
    joint_pos[:, ROBOT.joint("Left_Knee_Pitch")] += 0.3
    shank = [name for name, _, _ in retargeting.LIMBS].index("left_shank")
    errors = retargeting.limb_direction_error(human, posed(robot_clip(joint_pos)), ROBOT)
    np.testing.assert_allclose(errors[:, shank], 0.3, atol=1e-6)
    np.testing.assert_allclose(np.delete(errors, shank, axis=1), 0.0, atol=1e-6)


def test_a_turned_waist_is_a_heading_error_alone(still):
    human = person_of(still, ROBOT, np.array([0.1, 0.0, -0.04]))
    joint_pos = still.joint_pos.copy()
    joint_pos[:, ROBOT.joint("Waist")] -= 0.25
    poses = posed(robot_clip(joint_pos))
    np.testing.assert_allclose(retargeting.pelvis_heading_error(human, poses, ROBOT), 0.25, atol=1e-9)
    assert retargeting.trunk_orientation_error(human, poses, ROBOT).max() < 1e-9


def test_jerk_of_a_cubic_is_its_third_derivative():
    time_s = np.arange(40) / FPS
    joint_pos = np.zeros((40, 23))
    joint_pos[:, 10] = 2.0 * time_s**3
    assert retargeting.joint_jerk(robot_clip(joint_pos), ("Waist",)) == pytest.approx(12.0, rel=1e-6)


def test_jumps_are_the_frames_above_the_threshold():
    joint_pos = np.zeros((20, 23))
    joint_pos[8:, 3] = 1.1 * retargeting.JUMP_ACCELERATION / FPS**2
    np.testing.assert_array_equal(np.flatnonzero(retargeting.jump_frames(robot_clip(joint_pos))), [7, 8])
    joint_pos *= 0.8
    assert not retargeting.jump_frames(robot_clip(joint_pos)).any()


def test_drift_is_the_widest_way_within_each_stance():
    place = np.zeros((10, 3))
    place[:, 0] = [0.0, 0.03, 0.01, 5.0, 5.0, 1.0, 1.0, 1.004, 0.0, 0.0]
    contact = np.array([1, 1, 1, 0, 0, 1, 1, 1, 0, 0], dtype=bool)
    np.testing.assert_allclose(retargeting.stance_drifts(place, contact), [0.03, 0.004])
