"""Logs of a T1 that stands and sways, small and known to the last digit."""

import numpy as np

from pipeline.hardware_logs import (
    FallStates,
    LogFacts,
    LowCmds,
    LowStates,
    Odometry,
    OperatorEvent,
    RobotLog,
)
from pipeline.hardware_logs.messages import BUTTONS, ENCAPSULATION, payload_dtype
from pipeline.robot import Robot

START_NS = 1_750_000_000_000_000_000
POLICY = "ab" * 32
STICKS = ("lx", "ly", "rx", "ry")


def facts(**changes) -> LogFacts:
    values = {
        "robot": "t1",
        "policy_digest": POLICY,
        "command_source": "schedule",
        "simulated": True,
        "command": ((0.0, 0.0, 0.0, 0.0), (1.0, 0.5, -0.25, 0.125)),
        "events": (OperatorEvent(time_s=0.5, kind="held"), OperatorEvent(time_s=0.75, kind="released")),
    }
    return LogFacts(**(values | changes))


def every(seconds: float, rate_hz: float) -> np.ndarray:
    """Times of receipt without jitter."""
    return START_NS + np.round(np.arange(round(seconds * rate_hz)) / rate_hz * 1e9).astype(np.int64)


def low_states(robot: Robot, time_ns: np.ndarray) -> LowStates:
    """Every joint sways about its default by a speed of its own; the trunk stays upright."""
    time = (time_ns - START_NS)[:, None] * 1e-9
    joints = np.arange(len(robot.joint_names))
    speed = 1.0 + 0.1 * joints
    count, shape = len(time_ns), (len(time_ns), len(joints))
    low, high = robot.joint_lower, robot.joint_upper
    middle, reach = 0.5 * (low + high), 0.2 * np.minimum(high - low, 1.0)
    return LowStates(
        time_ns=time_ns,
        rpy=np.stack([0.02 * np.sin(time[:, 0]), 0.01 * np.cos(time[:, 0]), 0.1 * time[:, 0]], axis=1),
        gyro_b=np.tile([0.01, -0.02, 0.1], (count, 1)),
        acc_b=np.tile([0.05, -0.05, 9.81], (count, 1)),
        joint_pos=middle + reach * np.sin(speed * time),
        joint_vel=reach * speed * np.cos(speed * time),
        joint_acc=-reach * speed**2 * np.sin(speed * time),
        torque_est=np.broadcast_to(0.1 * joints, shape) + 0.01 * time,
        temperature_c=np.broadcast_to(30 + joints, shape).astype(np.int64),
        lost=np.broadcast_to(joints, shape) + (np.arange(count)[:, None] // 500),
    )


def sticks_and_buttons(
    time_ns: np.ndarray, sticks: np.ndarray, buttons: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Messages of the remote: lx, ly, rx, ry (m, 4) from -1 to 1, and `BUTTONS` (m, 12), 0 or 1."""
    values = np.zeros(len(time_ns), dtype=payload_dtype("RemoteControllerState"))
    values["encapsulation"], values["hat_c"] = np.void(ENCAPSULATION), 1
    for name, column in zip((*STICKS, *BUTTONS), (*sticks.T, *buttons.T), strict=True):
        values[name] = column
    return {"/remote_controller_state": (time_ns, values)}


def robot_log(robot: Robot, seconds: float = 2.0, **changes) -> RobotLog:
    """All five topics: 500, 50, 10, 50 and 20 messages a second."""
    shape = (len(every(seconds, 50)), len(robot.joint_names))
    times = {name: every(seconds, rate) for name, rate in (("state", 500), ("ctrl", 50), ("fall", 10), ("remote", 20))}
    fall, ctrl, remote = times["fall"], times["ctrl"], times["remote"]
    buttons = np.zeros((len(remote), 12), dtype=np.int64)
    buttons[len(remote) // 2 :, 10] = 1
    values = {
        "facts": facts(),
        "low_state": low_states(robot, times["state"]),
        "joint_ctrl": LowCmds(
            time_ns=ctrl,
            target_pos=robot.default_joint_pos + 0.01 * np.arange(shape[0])[:, None],
            target_torque=np.zeros(shape),
            kp=np.broadcast_to(robot.kp, shape),
            kd=np.broadcast_to(robot.kd, shape),
        ),
        "fall_down": FallStates(
            time_ns=fall,
            state=(np.arange(len(fall)) >= 15).astype(np.int64),
            recovery_available=np.ones(len(fall), dtype=np.int64),
        ),
        "odometer": Odometry(time_ns=ctrl, pose=0.01 * np.arange(shape[0])[:, None] * np.array([1.0, 0.5, 0.1])),
        "further": sticks_and_buttons(remote, np.tile([-0.5, -1.0, 0.25, 0.0], (len(remote), 1)), buttons),
    }
    return RobotLog(**(values | changes))


def noisy_log(robot: Robot, seconds: float, command_hz: float, rng: np.random.Generator) -> RobotLog:
    """A long log as a robot's would be: noise in every number, jitter in the times of receipt, some lost messages."""

    def received(rate_hz: float) -> np.ndarray:
        times = every(seconds, rate_hz) + rng.integers(0, 300_000, size=round(seconds * rate_hz))
        return times[rng.random(len(times)) > 0.001]

    time_ns = received(500)
    states = low_states(robot, time_ns)
    for name in ("rpy", "gyro_b", "acc_b", "joint_pos", "joint_vel", "joint_acc", "torque_est"):
        getattr(states, name)[:] += rng.normal(0.0, 1e-3, size=getattr(states, name).shape)
    ctrl, fall = received(command_hz), received(10)
    shape = (len(ctrl), len(robot.joint_names))
    return RobotLog(
        facts=facts(),
        low_state=states,
        joint_ctrl=LowCmds(
            time_ns=ctrl,
            target_pos=robot.default_joint_pos + rng.normal(0.0, 0.1, size=shape),
            target_torque=np.zeros(shape),
            kp=np.broadcast_to(robot.kp, shape),
            kd=np.broadcast_to(robot.kd, shape),
        ),
        fall_down=FallStates(time_ns=fall, state=np.zeros_like(fall), recovery_available=np.ones_like(fall)),
        odometer=Odometry(time_ns=ctrl, pose=rng.normal(size=(len(ctrl), 3))),
    )
