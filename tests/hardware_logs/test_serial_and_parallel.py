"""Joints are the serial ones: the parallel arrays of ankles are of cranks, in states as in commands."""

import numpy as np
import pytest

from pipeline.hardware_logs.columns import held_columns, low_state_columns
from pipeline.hardware_logs.messages import payload_dtype
from pipeline.hardware_logs.write import low_states
from pipeline.robot import Robot
from tests.factories.robot_logs import robot_log

SENSORS = {"q": "joint_pos", "dq": "joint_vel", "tau_est": "torque_est", "temperature": "temperature_c", "lost": "lost"}


def test_states_are_those_of_the_joints_and_not_of_the_cranks(robot: Robot):
    rows = low_states(robot_log(robot, 0.1).low_state)
    expected = {field: rows["motor_state_serial"][field].copy() for field in SENSORS}
    for field in SENSORS:
        rows["motor_state_parallel"][field] = 3 * rows["motor_state_parallel"][field] + 1
    columns = low_state_columns(rows)
    for field, name in SENSORS.items():
        np.testing.assert_array_equal(columns[name], expected[field], err_msg=name)


@pytest.mark.parametrize("serial", [True, False])
def test_of_commands_to_cranks_nothing_is_known_at_the_ankles(robot: Robot, serial: bool):
    ankles = [joint for joint, name in enumerate(robot.joint_names) if "Ankle" in name]
    others = [joint for joint in range(len(robot.joint_names)) if joint not in ankles]
    rows = np.zeros(4, dtype=payload_dtype("LowCmd", len(robot.joint_names)))
    for number, field in enumerate(("q", "tau", "kp", "kd"), start=1):
        rows["motor_cmd"][field] = number
    rows["cmd_type"] = 1
    rows["cmd_type"][2] = 1 if serial else 0
    columns = held_columns("/joint_ctrl", rows, np.array(ankles))
    for number, name in enumerate(("target_pos", "target_torque", "kp", "kd"), start=1):
        values = columns[name]
        assert np.isnan(values[2, ankles]).all() == (not serial)
        assert (values[2, others] == number).all() and (values[[0, 1, 3]] == number).all()
