"""Standing test: the robot holds a pose by explicit PD in MuJoCo, with the motors' torque limits.

An explicit controller is unstable if its damping is large relative to the inertia: with the armature of the real gears
the T1's stiff standing gains are stable, without it they are not.
"""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline.errors import FileError
from pipeline.files.csv_json import csv_records, plain_number, read_csv_text
from pipeline.robot import Kinematics, Robot, mujoco_model
from pipeline.simulation.torque_envelope import PdControl, TorqueEnvelope

TABLE = "standing.csv"
COLUMNS = ("joint", "kp", "kd", "pos", "vendor_armature")
TIMESTEP_S = 0.005
FALLEN_DEG = 60.0
"""Tilt above which the robot has fallen [deg]."""


@dataclass(frozen=True, kw_only=True)
class StandingPose:
    """Pose [rad] and gains [N m/rad, N m s/rad] in which the maker's controller stands before a policy starts."""

    kp: Float[np.ndarray, " j"]
    kd: Float[np.ndarray, " j"]
    joint_pos: Float[np.ndarray, " j"]
    vendor_armature: Float[np.ndarray, " j"]
    """Armature in the manufacturer's MuJoCo model [kg m^2]."""


@dataclass(frozen=True, kw_only=True)
class StandingResult:
    """Result of the standing test."""

    seconds: float
    """Time without a fall [s]."""
    fell: bool
    tilt_deg: float
    """Largest angle of the root from upright [deg]."""
    height: float
    """Height of the root at the end [m]."""


def read_standing_pose(folder: Path, robot: Robot) -> StandingPose | None:
    """The standing pose of a robot folder; None without one. Raises FileError."""
    path = folder / TABLE
    if not path.is_file():
        return None
    header, *rows = list(csv_records(read_csv_text(path).splitlines(), path)) or [[]]
    whole = tuple(header) == COLUMNS and all(len(row) == len(COLUMNS) for row in rows)
    if not whole or tuple(row[0] for row in rows) != robot.joint_names:
        do = f"The columns must be {', '.join(COLUMNS)}."
        raise FileError(path, "it is no table of the robot's joints in their order.", do)
    try:
        kp, kd, pos, vendor = np.array([[plain_number(cell) for cell in row[1:]] for row in rows]).T
    except ValueError as error:
        raise FileError(path, f"{error}.", "Write numbers.") from error
    return StandingPose(kp=kp, kd=kd, joint_pos=pos, vendor_armature=vendor)


def stand(
    robot: Robot, pose: StandingPose, envelope: TorqueEnvelope, armature: Float[np.ndarray, " j"], seconds: float = 10.0
) -> StandingResult:
    """Hold the pose from a start on the ground, with a given armature [kg m^2]."""
    model = mujoco_model(robot, ground=True, timestep=TIMESTEP_S)
    model.dof_armature[6:] = armature
    data = mujoco.MjData(model)
    corners = [corner for foot in robot.sole_corners for corner in foot]
    height = -float(Kinematics(robot).sites_of_pose(corners, pose.joint_pos)[:, 2].min())
    data.qpos[:] = np.concatenate([[0.0, 0.0, height], [1.0, 0.0, 0.0, 0.0], pose.joint_pos])
    control = PdControl(kp=pose.kp, kd=pose.kd, envelope=envelope)
    steps, worst = round(seconds / TIMESTEP_S), 0.0
    for step in range(steps):
        if not np.isfinite(data.qpos).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return StandingResult(seconds=step * TIMESTEP_S, fell=True, tilt_deg=180.0, height=0.0)
        data.qfrc_applied[6:] = control.torque(pose.joint_pos, data.qpos[7:], data.qvel[6:])
        mujoco.mj_step(model, data)
        upright = 1.0 - 2.0 * (data.qpos[4] ** 2 + data.qpos[5] ** 2)
        worst = max(worst, float(np.degrees(np.arccos(np.clip(upright, -1.0, 1.0)))))
        if worst > FALLEN_DEG:
            return StandingResult(seconds=step * TIMESTEP_S, fell=True, tilt_deg=worst, height=float(data.qpos[2]))
    return StandingResult(seconds=seconds, fell=False, tilt_deg=worst, height=float(data.qpos[2]))
