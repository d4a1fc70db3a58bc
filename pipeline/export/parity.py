"""Compare exported networks with the original over golden and random observations.

Golden vectors verify another implementation of the deployment: replaying their sensor readings from the start must give
the same observations, actions and targets. They are of the first second of a simulated walk, in which the history fills
and the command ramps up.
"""

import io
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.deployment import DeploymentTask, Policy, PolicyController, Reading
from pipeline.errors import FileError
from pipeline.export.card import check_stated
from pipeline.export.metadata import ExportError
from pipeline.export.networks import read_onnx, read_torch_script
from pipeline.files import atomic
from pipeline.files.npz import read_npz_header
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import MujocoOptions, MujocoPlant
from pipeline.simulation.run import run
from pipeline.simulation.sensors import DOWN_W
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope

SECONDS = 1.0
COMMAND = (0.6, -0.2, 0.3)
"""Forward and lateral velocity [m/s] and yaw rate [rad/s]; three different values, to detect swapped axes."""


@dataclass(frozen=True, kw_only=True)
class GoldenVectors:
    """K control steps of a task with J joints, of which the policy moves A."""

    gyro_b: Float[np.ndarray, "k 3"]
    """Angular velocity of the root in its frame [rad/s]."""
    gravity_b: Float[np.ndarray, "k 3"]
    """Direction of gravity in the root's frame."""
    command: Float[np.ndarray, "k 3"]
    joint_pos: Float[np.ndarray, "k j"]
    """In the robot's joint order [rad]."""
    joint_vel: Float[np.ndarray, "k j"]
    """In the robot's joint order [rad/s]."""
    observation: Float[np.ndarray, "k n"]
    action: Float[np.ndarray, "k a"]
    """In the policy's joint order [1]."""
    targets: Float[np.ndarray, "k j"]
    """In the robot's joint order [rad]."""


def golden_vectors(robot: Robot, task: DeploymentTask, policy: Policy) -> GoldenVectors:
    """Walk in MuJoCo for `SECONDS` from the default pose and record inputs and outputs."""
    plant = MujocoPlant(robot, MujocoOptions())
    motors = PdControl(kp=task.kp, kd=task.kd, envelope=TorqueEnvelope(limit=robot.torque_limit))
    walked = run(robot, plant, PolicyController(task, policy), motors, ramp, SECONDS, wrench_every=10_000)
    qpos, qvel = (values[:: walked.control_steps] for values in (walked.qpos, walked.qvel))
    gravity_b = rotation.rotate_inverse(qpos[:, 3:7], np.broadcast_to(DOWN_W, (len(qpos), 3)))
    readings = {"gyro_b": qvel[:, 3:6], "gravity_b": gravity_b, "joint_pos": qpos[:, 7:], "joint_vel": qvel[:, 6:]}
    return replay(task, policy, command=walked.command, **readings)


def ramp(time_s: float) -> Float[np.ndarray, " 3"]:
    """The command at a time [s]."""
    return np.array(COMMAND) * min(2.0 * time_s, 1.0)


def replay(task: DeploymentTask, policy: Policy, **readings: np.ndarray) -> GoldenVectors:
    """Controller outputs for readings `gyro_b, gravity_b, command, joint_pos, joint_vel`, each (k, …)."""
    controller = PolicyController(task, policy)
    made: dict[str, list[np.ndarray]] = {"observation": [], "action": [], "targets": []}
    sensed = {name: values for name, values in readings.items() if name != "command"}
    for step, command in enumerate(readings["command"]):
        reading = Reading(**{name: values[step] for name, values in sensed.items()})
        made["targets"].append(controller.targets(reading, command))
        made["observation"].append(controller.observation)
        made["action"].append(controller.last_action)
    return GoldenVectors(
        **{name: np.array(values) for name, values in readings.items()},
        **{name: np.array(values) for name, values in made.items()},
    )


def write_golden(path: Path, golden: GoldenVectors) -> None:
    """Write golden vectors as an npz in double precision, atomically.

    It is compressed to a fifth of its size, so another build of zlib may write other bytes for equal vectors.
    """
    stream = io.BytesIO()
    np.savez_compressed(stream, **{each.name: getattr(golden, each.name) for each in fields(golden)})
    atomic.write_bytes(path, stream.getvalue())


def read_golden(path: Path) -> GoldenVectors:
    """The golden vectors of an npz. Raises FileError, also if a card beside it has another digest."""
    check_stated(path)
    header = read_npz_header(path, most_bytes=100_000_000)
    names = [each.name for each in fields(GoldenVectors)]
    missing = [name for name in names if name not in header.numeric or len(header.shapes[name]) != 2]
    if missing:
        problem = f"has no golden vectors: these arrays are missing: {', '.join(missing)}."
        raise FileError(path, problem, "Export the policy again.")
    arrays = {name: header.array(name) for name in names}
    bad = ", ".join(name for name, values in arrays.items() if not np.isfinite(values).all())
    if bad or len({len(values) for values in arrays.values()}) != 1:
        problem = f"has {f'numbers that are not finite in {bad}' if bad else 'arrays of unequal length'}."
        raise FileError(path, problem, "Export the policy again.")
    return GoldenVectors(**arrays)


TOLERANCE = 1e-5
"""Largest allowed difference of an action [1]; in a joint target, it is a quarter of this [rad]."""
LARGE = 10.0
"""Magnitude of an action above which a relative 1e-6 is allowed, for single precision."""
RANDOM = 256
"""Number of random observations."""


@dataclass(frozen=True, kw_only=True)
class Parity:
    """Largest absolute differences from the network in double precision."""

    onnx: float
    torch_script: float
    times_allowed: float
    """Largest ratio of a difference to its tolerance, over both formats."""
    runtime: str
    """The runtime of the ONNX file."""
    observations: int

    @property
    def holds(self) -> bool:
        return self.times_allowed <= 1.0


def observations_to_compare(
    policy: Policy, golden: Float[np.ndarray, "g n"], rng: np.random.Generator
) -> Float[np.ndarray, "m n"]:
    """Golden observations, then random ones with the mean and scale of the normalizer."""
    random = policy.mean + policy.scale * rng.normal(size=(RANDOM, policy.observation_size))
    return np.concatenate([golden, random])


def measure_parity(
    policy: Policy, onnx_path: Path, torch_script_path: Path, observations: Float[np.ndarray, "m n"]
) -> Parity:
    """Run both files on observations. Raises ExportError if either exceeds the tolerance."""
    import torch

    wanted = policy.act(observations)
    single = observations.astype(np.float32)
    runtime, action = _run_onnx(onnx_path, single)
    module, _ = read_torch_script(torch_script_path)
    with torch.no_grad():
        scripted = module(torch.from_numpy(single)).numpy()
    allowed = TOLERANCE * np.maximum(1.0, np.abs(wanted) / LARGE)
    off = [np.abs(each - wanted) for each in (action, scripted)]
    parity = Parity(
        onnx=float(off[0].max()),
        torch_script=float(off[1].max()),
        times_allowed=float(max((each / allowed).max() for each in off)),
        runtime=runtime,
        observations=len(observations),
    )
    if not parity.holds:
        raise ExportError(
            f"exported networks are not the policy: over {len(observations)} observations actions differ by "
            f"{parity.onnx:.2e} (ONNX, {runtime}) and {parity.torch_script:.2e} (TorchScript); "
            f"allowed is {TOLERANCE:.0e}, or a millionth of an action beyond {LARGE:g}; the largest is "
            f"{np.abs(wanted).max():.1f}. Export it again from the trained network."
        )
    return parity


def _run_onnx(path: Path, observations: np.ndarray) -> tuple[str, np.ndarray]:
    """Actions of the ONNX file, by onnxruntime if installed, else by ONNX's reference evaluator."""
    model, _ = read_onnx(path)
    try:
        import onnxruntime
    except ImportError:
        from onnx.reference import ReferenceEvaluator

        (action,) = ReferenceEvaluator(model).run(None, {"observation": observations})  # pyright: ignore
        return "onnx.reference", np.asarray(action)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    (action,) = session.run(None, {"observation": observations})
    return "onnxruntime", np.asarray(action)
