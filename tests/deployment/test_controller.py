"""Observation and targets number by number: each entry is identifiable, so that a swap shows."""

import dataclasses

import numpy as np
import pytest

from pipeline.deployment import (
    DeploymentTask,
    History,
    PolicyController,
    PolicyGains,
    deployment_task,
    frame,
    policy_task,
)
from pipeline.deployment.controller import PolicyMisfitError, Reading
from pipeline.deployment.task import PolicyJointsError, in_order
from pipeline.errors import UnknownNameError
from pipeline.robot import Robot
from tests.factories.policies import linear_policy, still_policy

VENDOR_ORDER = (
    "Left_Shoulder_Pitch",
    "Right_Shoulder_Pitch",
    "Waist",
    "Left_Shoulder_Roll",
    "Right_Shoulder_Roll",
    "Left_Hip_Pitch",
    "Right_Hip_Pitch",
    "Left_Elbow_Pitch",
    "Right_Elbow_Pitch",
    "Left_Hip_Roll",
    "Right_Hip_Roll",
    "Left_Elbow_Yaw",
    "Right_Elbow_Yaw",
    "Left_Hip_Yaw",
    "Right_Hip_Yaw",
    "Left_Knee_Pitch",
    "Right_Knee_Pitch",
    "Left_Ankle_Pitch",
    "Right_Ankle_Pitch",
    "Left_Ankle_Roll",
    "Right_Ankle_Roll",
)
"""Joint order that the vendor's published policy states in words."""


@pytest.fixture
def task(robot: Robot) -> DeploymentTask:
    return deployment_task(robot)


def _reading_and_command(task: DeploymentTask) -> tuple[Reading, np.ndarray]:
    """A reading and a command of numbers that are all different."""
    count = len(task.joint_names)
    reading = Reading(
        gyro_b=np.array([0.1, 0.2, 0.3]),
        gravity_b=np.array([0.4, 0.5, 0.6]),
        joint_pos=task.default_joint_pos + 100.0 + np.arange(count),
        joint_vel=200.0 + np.arange(count),
    )
    return reading, np.array([0.7, 0.8, 0.9])


def test_the_networks_joints_are_the_controlled_ones_in_the_vendors_order(task: DeploymentTask):
    assert task.policy_joints == VENDOR_ORDER
    assert task.observation_size == 720
    assert [task.joint_names[index] for index in task.policy_index] == list(VENDOR_ORDER)


def test_a_frame_has_each_number_in_its_place(task: DeploymentTask):
    action = 300.0 + np.arange(21)
    found = frame(task, *_reading_and_command(task), action)
    np.testing.assert_allclose(found[:9], np.arange(1, 10) / 10.0)
    np.testing.assert_allclose(found[9:30], 100.0 + task.policy_index)
    np.testing.assert_allclose(found[30:51], 200.0 + task.policy_index)
    np.testing.assert_array_equal(found[51:], action)


def test_the_parts_of_a_reading_are_taken_by_keyword_alone(task: DeploymentTask):
    with pytest.raises(TypeError, match="positional"):
        Reading(*vars(_reading_and_command(task)[0]).values())  # type: ignore[reportCallIssue]


def test_the_history_starts_with_zeros_and_has_the_newest_last(task: DeploymentTask):
    history = History(task)
    seen = np.zeros(task.observation_size)
    for number in range(1, 13):
        seen = history.push(np.full(72, float(number)))
        if number == 3:
            np.testing.assert_array_equal(seen.reshape(10, 72)[:, 0], [0.0] * 7 + [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(seen.reshape(10, 72)[:, 0], np.arange(3, 13))
    history.reset()
    np.testing.assert_array_equal(history.push(np.ones(72))[:-72], 0.0)


def test_targets_are_default_plus_a_quarter_of_the_action_and_the_head_is_held(task: DeploymentTask):
    bias = np.arange(1.0, 22.0)
    controller = PolicyController(task, linear_policy(np.zeros((21, 720)), bias))
    targets = controller.targets(*_reading_and_command(task))
    away = dict(zip(task.joint_names, targets - task.default_joint_pos, strict=True))
    assert away["AAHead_yaw"] == away["Head_pitch"] == 0.0
    for number, name in enumerate(VENDOR_ORDER, 1):
        assert away[name] == pytest.approx(0.25 * number)


def test_the_last_action_comes_back_and_reset_forgets_it(task: DeploymentTask):
    weight = np.zeros((21, 720))
    weight[:, -21:] = np.eye(21)
    controller = PolicyController(task, linear_policy(weight, np.ones(21)))
    for step in range(1, 4):
        controller.targets(*_reading_and_command(task))
        np.testing.assert_array_equal(controller.last_action, step)
    controller.reset()
    controller.targets(*_reading_and_command(task))
    np.testing.assert_array_equal(controller.last_action, 1.0)
    np.testing.assert_array_equal(controller.observation[:-72], 0.0)


def test_two_controllers_share_nothing(task: DeploymentTask):
    policy = still_policy(task)
    one, two = PolicyController(task, policy), PolicyController(task, policy)
    one.targets(*_reading_and_command(task))
    assert not two.observation.any()
    assert one.targets(*_reading_and_command(task)) is not task.default_joint_pos


def test_a_fork_goes_on_alike_and_apart(task: DeploymentTask):
    weight = np.zeros((21, 720))
    weight[:, -21:] = np.eye(21)
    controller = PolicyController(task, linear_policy(weight, np.ones(21)))
    controller.targets(*_reading_and_command(task))
    fork = controller.fork()
    np.testing.assert_array_equal(
        fork.targets(*_reading_and_command(task)), controller.targets(*_reading_and_command(task))
    )
    np.testing.assert_array_equal(fork.observation, controller.observation)
    fork.targets(*_reading_and_command(task))
    np.testing.assert_array_equal(controller.last_action, 2.0)
    np.testing.assert_array_equal(fork.last_action, 3.0)


def test_a_policy_of_other_sizes_is_refused(task: DeploymentTask):
    with pytest.raises(PolicyMisfitError, match=r"700 observations and 21 actions; robot 't1' takes 720 and 21"):
        PolicyController(task, linear_policy(np.zeros((21, 700))))
    short = dataclasses.replace(task, history=5)
    with pytest.raises(PolicyMisfitError, match="5 frames of 72"):
        PolicyController(short, linear_policy(np.zeros((21, 720))))


def test_the_gains_that_travel_with_a_policy_are_used_by_name(robot: Robot, task: DeploymentTask):
    order = np.random.default_rng(0).permutation(len(task.joint_names))
    gains = PolicyGains(
        joint_names=tuple(task.joint_names[index] for index in order),
        kp=10.0 + order,
        kd=0.1 * (10.0 + order),
        default_joint_pos=task.default_joint_pos[order] + 0.01,
    )
    found = policy_task(robot, still_policy(task, gains=gains))
    np.testing.assert_allclose(found.kp, 10.0 + np.arange(len(order)))
    np.testing.assert_allclose(found.kd, 0.1 * found.kp)
    np.testing.assert_allclose(found.default_joint_pos, task.default_joint_pos + 0.01)
    np.testing.assert_array_equal(policy_task(robot, still_policy(task)).kp, robot.kp)


def test_a_policy_that_lacks_a_joint_names_it_and_the_robot(robot: Robot, task: DeploymentTask):
    count = len(task.joint_names) - 1
    gains = PolicyGains(
        joint_names=task.joint_names[:-1], kp=np.ones(count), kd=np.ones(count), default_joint_pos=np.zeros(count)
    )
    with pytest.raises(
        PolicyJointsError, match=f"does not fit robot 't1': it lacks the joints {task.joint_names[-1]}\\. "
    ):
        policy_task(robot, still_policy(task, gains=gains))


def test_gains_come_in_the_order_asked_for():
    np.testing.assert_array_equal(in_order(np.array([1.0, 2.0, 3.0]), ("a", "b", "c"), ("c", "a")), [3.0, 1.0])
    with pytest.raises(UnknownNameError, match="unknown joint 'd'"):
        in_order(np.zeros(3), ("a", "b", "c"), ("d",))
