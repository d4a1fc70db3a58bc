"""Golden vectors: sensor readings, observations, actions and joint targets, step by step.

Whoever writes the deployment again replays the sensor readings from the start and must get these observations, actions
and targets. They are of the first second of a walk in simulation: the history fills and the command ramps up.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.deployment import DeploymentTask, Policy, PolicyController
from pipeline.errors import FileError
from pipeline.export.card import check_stated
from pipeline.files import atomic
from pipeline.files.npz import NpzCaps, read_npz_header
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.pd_control import PdControl
from pipeline.simulation.run import run
from pipeline.simulation.torque_envelope import TorqueEnvelope

SECONDS = 1.0
COMMAND = (0.6, -0.2, 0.3)
"""Forward and lateral velocity [m/s] and yaw rate [rad/s]; three different numbers, so that a swap shows."""
CAPS = NpzCaps(members=50, member_bytes=100_000_000, total_bytes=100_000_000, ratio=1_000)
DOWN_W = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, kw_only=True)
class GoldenVectors:
    """K control steps of a task with J joints of which A are the policy's."""

    gyro_b: Float[np.ndarray, "k 3"]
    """Angular velocity of the root in its frame [rad/s]."""
    gravity_b: Float[np.ndarray, "k 3"]
    """Direction of gravity in the root's frame."""
    command: Float[np.ndarray, "k 3"]
    joint_pos: Float[np.ndarray, "k j"]
    """Robot's order [rad]."""
    joint_vel: Float[np.ndarray, "k j"]
    """Robot's order [rad/s]."""
    observation: Float[np.ndarray, "k n"]
    action: Float[np.ndarray, "k a"]
    """Policy's order."""
    targets: Float[np.ndarray, "k j"]
    """Robot's order [rad]."""


def golden_vectors(robot: Robot, task: DeploymentTask, policy: Policy) -> GoldenVectors:
    """Walk in MuJoCo for `SECONDS` from the default pose and record inputs and outputs."""
    plant = MujocoPlant(robot, MujocoOptions())
    motors = PdControl(kp=task.kp, kd=task.kd, envelope=TorqueEnvelope(limit=robot.torque_limit))
    walked = run(robot, plant, PolicyController(task, policy), motors, ramp, SECONDS, wrench_every=10_000)
    at = slice(None, None, walked.control_steps)
    return replay(
        task,
        policy,
        gyro_b=walked.qvel[at, 3:6],
        gravity_b=rotation.rotate_inverse(walked.qpos[at, 3:7], np.broadcast_to(DOWN_W, walked.qpos[at, :3].shape)),
        command=walked.command,
        joint_pos=walked.qpos[at, 7:],
        joint_vel=walked.qvel[at, 6:],
    )


def ramp(time_s: float) -> Float[np.ndarray, " 3"]:
    """The command at a time [s]."""
    return np.array(COMMAND) * min(2.0 * time_s, 1.0)


def replay(task: DeploymentTask, policy: Policy, **readings: np.ndarray) -> GoldenVectors:
    """Controller outputs for readings `gyro_b, gravity_b, command, joint_pos, joint_vel`, each (k, …)."""
    controller = PolicyController(task, policy)
    made: dict[str, list[np.ndarray]] = {"observation": [], "action": [], "targets": []}
    for step in range(len(readings["command"])):
        made["targets"].append(controller.targets(**{name: values[step] for name, values in readings.items()}))
        made["observation"].append(controller.observation)
        made["action"].append(controller.last_action)
    return GoldenVectors(
        **{name: np.array(values) for name, values in readings.items()},
        **{name: np.array(values) for name, values in made.items()},
    )


def write_golden(path: Path, golden: GoldenVectors) -> None:
    """Write golden vectors as an npz of double precision, whole or not at all."""
    stream = io.BytesIO()
    np.savez(stream, **{each.name: getattr(golden, each.name) for each in fields(golden)})
    atomic.write_bytes(path, stream.getvalue())


def read_golden(path: Path) -> GoldenVectors:
    """The golden vectors of an npz. Raises FileError, also where a card beside it states another content."""
    check_stated(path)
    header = read_npz_header(path, CAPS)
    names = [each.name for each in fields(GoldenVectors)]
    missing = [name for name in names if name not in header.numeric or len(header.shapes[name]) != 2]
    if missing:
        problem = f"has no golden vectors: no table of numbers is {', '.join(missing)}."
        raise FileError(path, problem, "Export the policy again.")
    arrays = {name: header.array(name) for name in names}
    bad = [name for name, values in arrays.items() if not np.isfinite(values).all()]
    if bad or len({len(values) for values in arrays.values()}) != 1:
        problem = f"has {'numbers that are not finite in ' + ', '.join(bad) if bad else 'arrays of unequal length'}."
        raise FileError(path, problem, "Export the policy again.")
    return GoldenVectors(**arrays)
