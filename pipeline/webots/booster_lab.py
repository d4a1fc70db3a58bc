"""The controller of the Webots project: sensors to the policy's observation, its targets to motor torques.

Webots starts it in a folder with all it needs besides numpy: `task.json` (joints, gains, motor limits), `policy.npz`
(without it the robot holds its default pose), `run.json` (the commands, and where to write the result) and our own
modules. Each step is that of the robot: `PolicyController` for targets, `PdControl` for torques. The supervisor is used
for scoring only.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE / "shims"))  # last: an installed jaxtyping takes precedence

from pipeline.deployment import DeploymentTask, PolicyController, Reading, load_policy  # noqa: E402
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope  # noqa: E402

SCHEMA = "booster-lab webots result 1"
FIGURES = ("forward_m_s", "lateral_m_s", "yaw_rate_rad_s", "height_m")
RESULT_MARK = "BOOSTER_LAB_RESULT "


class Devices:
    """Motors and sensors of the robot, in the joint order of the task."""

    def __init__(self, robot: Any, joint_names: tuple[str, ...], names: dict[str, str]):
        step = int(robot.getBasicTimeStep())
        self.motors = [robot.getDevice(name) for name in joint_names]
        self.sensors = [robot.getDevice(name + names["sensor_suffix"]) for name in joint_names]
        self.gyro, self.imu = robot.getDevice(names["gyro"]), robot.getDevice(names["inertial_unit"])
        missing = [name for name, motor in zip(joint_names, self.motors, strict=True) if motor is None]
        if missing or None in (*self.sensors, self.gyro, self.imu):
            raise SystemExit(f"the robot lacks devices: {', '.join(missing) or 'a sensor of the joints or the trunk'}")
        for sensor in (*self.sensors, self.gyro, self.imu):
            sensor.enable(step)

    def joint_pos(self) -> np.ndarray:
        """[rad]"""
        return np.array([sensor.getValue() for sensor in self.sensors])

    def reading(self, joint_pos: np.ndarray, joint_vel: np.ndarray) -> Reading:
        """Sensor reading for the controller. Gravity in the trunk's frame is minus the third row of the rotation."""
        x, y, z, w = self.imu.getQuaternion()
        gravity_b = -np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])
        gyro_b = np.array(self.gyro.getValues())
        return Reading(gyro_b=gyro_b, gravity_b=gravity_b, joint_pos=joint_pos, joint_vel=joint_vel)

    def set_torque(self, torque: np.ndarray) -> None:
        for motor, value in zip(self.motors, torque, strict=True):
            motor.setTorque(float(value))


class Plan:
    """The command over time: consecutive segments, with slewed transitions."""

    def __init__(self, segments: list[dict[str, Any]]):
        self.segments = segments
        self.ends = np.cumsum([segment["seconds"] for segment in segments])
        self.command = np.zeros(3)

    @property
    def seconds(self) -> float:
        return float(self.ends[-1])

    def index(self, time_s: float) -> int:
        """The segment at a time; the last one after the end."""
        return min(int(np.searchsorted(self.ends, time_s + 1e-9, side="right")), len(self.segments) - 1)

    def advance(self, time_s: float, dt_s: float) -> np.ndarray:
        """The command at a time, one control step after the last call."""
        segment = self.segments[self.index(time_s)]
        most = segment["slew"] * dt_s if segment["slew"] > 0.0 else np.inf
        self.command = self.command + np.clip(np.array(segment["command"]) - self.command, -most, most)
        return self.command.copy()


class Score:
    """Mean velocities over the end of each segment, and the time of a fall: below a height or beyond a tilt.

    Velocities are differences of trunk positions: `getVelocity` returns that of the centre of mass, which differs on a
    curve.
    """

    def __init__(self, plan: Plan, measured_s: float, fall: dict[str, float]):
        self.plan, self.measured_s, self.fall = plan, measured_s, fall
        self.sums = np.zeros((len(plan.segments), 5))
        self.before: tuple[float, np.ndarray] | None = None
        self.fell_s: float | None = None

    def update(self, node: Any, time_s: float) -> None:
        """Add the robot's current state."""
        turn, place = np.array(node.getOrientation()).reshape(3, 3), np.array(node.getPosition())
        height = float(place[2])
        upright = height >= self.fall["height_m"] and turn[2, 2] >= self.fall["tilt_cos"]
        if not (math.isfinite(height) and upright):
            self.fell_s = time_s
            return
        before, self.before = self.before, (time_s, place)
        index = self.plan.index(time_s)
        if before is None or time_s < self.plan.ends[index] - self.measured_s:
            return
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        vx, vy, _ = (place - before[1]) / (time_s - before[0])
        forward = math.cos(yaw) * vx + math.sin(yaw) * vy
        lateral = -math.sin(yaw) * vx + math.cos(yaw) * vy
        self.sums[index] += [forward, lateral, node.getVelocity()[5], height, 1.0]

    def segments(self, time_s: float) -> list[dict[str, Any]]:
        """One row per segment; figures are None if the segment was not walked to its end."""
        rows = []
        for segment, end, sums in zip(self.plan.segments, self.plan.ends, self.sums, strict=True):
            walked = bool(time_s >= end - 1e-6 and sums[4] > 0.0)
            means = (sums[:4] / sums[4]).tolist() if walked else [None] * 4
            rows.append({"name": segment["name"], "walked": walked, **dict(zip(FIGURES, means, strict=True))})
        return rows


def main() -> None:
    """Walk the plan, write the result and end the simulation."""
    from controller import Supervisor  # pyright: ignore[reportMissingImports]

    config = json.loads((HERE / "task.json").read_text(encoding="utf-8"))
    run = json.loads((HERE / "run.json").read_text(encoding="utf-8"))
    robot = Supervisor()
    timestep_s = robot.getBasicTimeStep() / 1000.0
    task, motors = task_of(config), motors_of(config)
    devices = Devices(robot, task.joint_names, config["devices"])
    policy_file = HERE / "policy.npz"
    controller = PolicyController(task, load_policy(policy_file)) if policy_file.is_file() else None
    plan = Plan(run["segments"])
    score = Score(plan, run["measured_s"], config["fall"])
    time_s = walk(robot, devices, controller, task, motors, plan, score, timestep_s)
    result = {
        "schema": SCHEMA,
        "run": run["run"],
        "timestep_ms": timestep_s * 1000.0,
        "seconds": time_s,
        "fell_s": score.fell_s,
        "policy": controller is not None,
        "segments": score.segments(time_s),
    }
    text = json.dumps(result, allow_nan=False)
    aside = HERE / (run["result"] + ".part")
    aside.write_text(text, encoding="utf-8")
    aside.replace(HERE / run["result"])
    print(RESULT_MARK + text, flush=True)
    robot.simulationQuit(0)


def walk(
    robot: Any,
    devices: Devices,
    controller: PolicyController | None,
    task: DeploymentTask,
    motors: PdControl,
    plan: Plan,
    score: Score,
    timestep_s: float,
) -> float:
    """Walk until the plan's end, a fall, or the simulation's end; return the time reached [s].

    Webots has no joint speed sensor: speeds are differences of positions over a timestep. Its motors hold a position
    until a torque is set, so zero torque is set before the first step.
    """
    node = robot.getSelf()
    devices.set_torque(np.zeros(len(task.joint_names)))
    decimation = max(round(1.0 / (task.control_hz * timestep_s)), 1)
    targets, before = task.default_joint_pos.copy(), None
    tick = 0
    while robot.step(round(timestep_s * 1000.0)) != -1:
        joint_pos = devices.joint_pos()
        joint_vel = np.zeros_like(joint_pos) if before is None else (joint_pos - before) / timestep_s
        before = joint_pos
        time_s = tick * timestep_s
        if time_s >= plan.seconds - 1e-9:
            return time_s
        score.update(node, time_s)
        if score.fell_s is not None:
            return time_s
        if tick % decimation == 0:
            command = plan.advance(time_s, decimation * timestep_s)
            if controller is not None:
                targets = controller.targets(devices.reading(joint_pos, joint_vel), command)
        devices.set_torque(motors.torque(targets, joint_pos, joint_vel))
        tick += 1
    return tick * timestep_s


def task_of(config: dict[str, Any]) -> DeploymentTask:
    """The deployment task in `task.json`."""
    arrays = {name: np.array(config[name]) for name in ("default_joint_pos", "kp", "kd")}
    names = {name: tuple(config[name]) for name in ("joint_names", "policy_joints")}
    numbers = {name: config[name] for name in ("robot", "action_scale", "history", "control_hz")}
    return DeploymentTask(**arrays, **names, **numbers)


def motors_of(config: dict[str, Any]) -> PdControl:
    """Gains and torque limits in `task.json`."""
    limits = {name: None if value is None else np.array(value) for name, value in config["motors"].items()}
    envelope = TorqueEnvelope(**limits)  # pyright: ignore[reportArgumentType]
    return PdControl(kp=np.array(config["kp"]), kd=np.array(config["kd"]), envelope=envelope)


if __name__ == "__main__":
    main()
