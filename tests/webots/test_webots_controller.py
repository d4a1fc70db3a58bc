"""The controller's parts against devices of paper: attitude, speeds, commands, scores, the simulation's end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline import rotation
from pipeline.deployment import DeploymentTask, deployment_task
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope
from pipeline.webots.booster_lab import Devices, Plan, Score, motors_of, walk

NAMES = {"gyro": "gyro", "inertial_unit": "imu", "sensor_suffix": "_sensor"}
TIMESTEP_S = 0.005


class Paper:
    """A device that says what it is told to, and keeps what it is given."""

    def __init__(self) -> None:
        self.enabled, self.torques = 0, []
        self.value: Any = 0.0

    def enable(self, period: int) -> None:
        self.enabled = period

    def getValue(self) -> float:
        return self.value

    def getValues(self) -> list[float]:
        return list(self.value)

    def getQuaternion(self) -> list[float]:
        return list(self.value)

    def setTorque(self, torque: float) -> None:
        self.torques.append(torque)


class PaperRobot:
    """One that is carried along without moving, turned about z, for a number of steps.

    Its centre of mass goes another way than its origin, as on a curve.
    """

    def __init__(self, steps: int, yaw: float = 0.0):
        self.devices: dict[str, Paper] = {}
        self.left, self.taken = steps, 0
        self.turn = rotation.to_matrix(rotation.about_z(yaw))
        self.velocity_b, self.of_com_b = np.array([0.5, -0.1, 0.0]), np.array([0.0, 0.055, 0.0])
        self.joint_speed, self.height = 0.0, 0.68

    def getBasicTimeStep(self) -> float:
        return 5.0

    def getDevice(self, name: str) -> Paper:
        return self.devices.setdefault(name, Paper())

    def step(self, duration: int) -> int:
        assert duration == 5
        self.left, self.taken = self.left - 1, self.taken + 1
        for name, device in self.devices.items():
            if name.endswith("_sensor"):
                device.value = self.taken * TIMESTEP_S * self.joint_speed
        self.devices["gyro"].value, self.devices["imu"].value = [0.0] * 3, [0.0, 0.0, 0.0, 1.0]
        return -1 if self.left < 0 else 0

    def getSelf(self) -> PaperRobot:
        return self

    def getPosition(self) -> list[float]:
        x, y, _ = self.taken * TIMESTEP_S * (self.turn @ self.velocity_b)
        return [x, y, self.height]

    def getOrientation(self) -> list[float]:
        return self.turn.ravel().tolist()

    def getVelocity(self) -> list[float]:
        return [*(self.turn @ (self.velocity_b + self.of_com_b)).tolist(), 0.0, 0.0, 0.3]


@pytest.fixture
def task(robot: Robot) -> DeploymentTask:
    return deployment_task(robot)


def a_plan(*seconds: float) -> Plan:
    return Plan(
        [{"name": str(n), "seconds": each, "command": [0.5, 0.0, 0.3], "slew": 1.0} for n, each in enumerate(seconds)]
    )


def walked(robot: PaperRobot, task: DeploymentTask, plan: Plan) -> tuple[float, Score, Devices]:
    devices = Devices(robot, task.joint_names, NAMES)
    motors = PdControl(kp=task.kp, kd=task.kd, envelope=TorqueEnvelope(limit=np.full(len(task.kp), 1e3)))
    score = Score(plan, 0.5, {"height_m": 0.45, "tilt_cos": 0.5})
    return walk(robot, devices, None, task, motors, plan, score, TIMESTEP_S), score, devices


@pytest.mark.parametrize("seed", range(4))
def test_gravity_comes_from_the_attitude(task: DeploymentTask, seed: int):
    robot = PaperRobot(1)
    devices = Devices(robot, task.joint_names, NAMES)
    quat = rotation.normalize(np.random.default_rng(seed).normal(size=4))
    robot.devices["gyro"].value, robot.devices["imu"].value = [0.1, 0.2, 0.3], np.roll(quat, -1)  # x, y, z, w
    reading = devices.reading(task.default_joint_pos, np.zeros_like(task.default_joint_pos))
    down = rotation.rotate_inverse(quat, np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(reading.gravity_b, down, atol=1e-12)
    np.testing.assert_array_equal(reading.gyro_b, [0.1, 0.2, 0.3])


def test_every_sensor_is_read_each_timestep(task: DeploymentTask):
    robot = PaperRobot(1)
    Devices(robot, task.joint_names, NAMES)
    sensors = [device for name, device in robot.devices.items() if name.endswith("_sensor") or name in ("gyro", "imu")]
    assert len(sensors) == len(task.joint_names) + 2
    assert all(device.enabled == 5 for device in sensors)


def test_speeds_are_differences_of_positions(task: DeploymentTask):
    """Joints that turn at 2 rad/s: the torque has -kd 2 in it from the second timestep on, and nothing at the first."""
    robot = PaperRobot(3)
    robot.joint_speed = 2.0
    _, _, devices = walked(robot, task, a_plan(1.0))
    before, first, second, _ = np.array([motor.torques for motor in devices.motors]).T  # pyright: ignore
    assert not before.any()  # motors that were given no torque hold positions
    position = np.array([1.0, 2.0])[:, None] * TIMESTEP_S * 2.0
    spring = task.kp * (task.default_joint_pos - position)
    np.testing.assert_allclose(first, spring[0], atol=1e-9)
    np.testing.assert_allclose(second, spring[1] - 2.0 * task.kd, atol=1e-9)


def test_the_command_is_slewed_and_kept_between_segments():
    plan = Plan(
        [
            {"name": "a", "seconds": 0.1, "command": [1.0, 0.0, 0.0], "slew": 2.0},
            {"name": "b", "seconds": 0.1, "command": [0.0, 0.0, -1.0], "slew": 0.0},
        ]
    )
    commands = [plan.advance(tick * 0.02, 0.02) for tick in range(6)]
    np.testing.assert_allclose([command[0] for command in commands], [0.04, 0.08, 0.12, 0.16, 0.2, 0.0], atol=1e-12)
    np.testing.assert_allclose(commands[-1], [0.0, 0.0, -1.0])


@pytest.mark.parametrize("yaw", [0.0, 2.0, -3.0])
def test_scores_are_means_in_the_heading_whatever_it_is(task: DeploymentTask, yaw: float):
    time_s, score, _ = walked(PaperRobot(10_000, yaw), task, a_plan(1.0, 1.0))
    assert time_s == pytest.approx(2.0)
    for row in score.segments(time_s):
        assert row["walked"]
        assert (row["forward_m_s"], row["lateral_m_s"]) == pytest.approx((0.5, -0.1))
        assert (row["yaw_rate_rad_s"], row["height_m"]) == pytest.approx((0.3, 0.68))


def test_the_simulations_end_ends_the_walk_without_figures_of_what_was_not_walked(task: DeploymentTask):
    time_s, score, _ = walked(PaperRobot(300), task, a_plan(1.0, 1.0))
    assert time_s == pytest.approx(1.5)
    first, second = score.segments(time_s)
    assert first["walked"] and not second["walked"]
    assert second["forward_m_s"] is None


def test_a_fall_is_noted_and_ends_the_walk(task: DeploymentTask):
    robot = PaperRobot(10_000)
    robot.height = 0.4
    time_s, score, _ = walked(robot, task, a_plan(1.0))
    assert (time_s, score.fell_s) == (0.0, 0.0)
    nowhere = PaperRobot(10_000)
    nowhere.turn = np.full((3, 3), np.nan)
    assert walked(nowhere, task, a_plan(1.0))[1].fell_s == 0.0
    tipped = PaperRobot(10_000)
    tipped.turn = rotation.to_matrix(rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.radians(61.0)))
    assert walked(tipped, task, a_plan(1.0))[1].fell_s == 0.0


def test_a_robot_without_a_device_is_told_by_name(task: DeploymentTask):
    robot = PaperRobot(1)
    robot.getDevice = lambda name: None if name == "Waist" else Paper()  # pyright: ignore
    with pytest.raises(SystemExit, match=r"^the robot lacks devices: Waist$"):
        Devices(robot, task.joint_names, NAMES)


def test_motors_have_the_envelope_that_the_task_states(task: DeploymentTask):
    count = len(task.joint_names)
    said = {
        "kp": task.kp.tolist(),
        "kd": task.kd.tolist(),
        "motors": {"limit": [10.0] * count, "knee_speed": [5.0] * count, "no_load_speed": [10.0] * count},
    }
    motors = motors_of(said)
    torque = motors.torque(np.full(count, 100.0), np.zeros(count), np.full(count, 7.5))
    np.testing.assert_allclose(torque, 5.0)
    flat = motors_of({**said, "motors": {"limit": [10.0] * count, "knee_speed": None, "no_load_speed": None}})
    np.testing.assert_allclose(flat.torque(np.full(count, 100.0), np.zeros(count), np.full(count, 7.5)), 10.0)
