"""Criteria on simulated forces: motor saturation, and consistency of contact forces with the motion."""

import functools
from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.robot_clip import SimulatedForces
from pipeline.feasibility.criterion import Criterion, Result, Seconds, ShareOfFrames, Skipped, Verdict, criterion
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_time import odd_width, share_and_run, windowed_mean
from pipeline.files.ranges import POSITIVE, Range
from pipeline.files.sourced import Unit
from pipeline.physics import GRAVITY
from pipeline.robot import Kinematics, Robot

NO_FORCES = "no simulation recorded its forces"

CODES = ("torque_saturation_share", "torque_saturation_run_s", "force_residual")


@dataclass(frozen=True, kw_only=True)
class TorqueSettings:
    """Limits for a rollout's motor torques and contact forces."""

    saturation: Annotated[float, Range(0.5, 1.0), Unit("of the torque limit")]
    """Share of the torque limit above which a motor is saturated."""
    saturation_share: ShareOfFrames
    """Largest share of a joint's frames in which its motor is saturated."""
    saturation_run_s: Seconds
    """Longest uninterrupted saturation of a motor [s]."""
    force_residual: Annotated[float, POSITIVE, Unit("of the weight")]
    """Largest windowed mean of the force not explained by contacts and pushes, relative to the robot's weight."""
    residual_window_s: Annotated[float, Range(0.02, 10.0), Unit("s")]
    """Length of the window [s]."""


@criterion(
    Criterion(
        CODES[0],
        "torque",
        "torque.saturation_share",
        "of frames",
        "share of frames with a motor at its torque limit, worst joint",
    ),
    Criterion(CODES[1], "torque", "torque.saturation_run_s", "s", "longest time that a motor is at its torque limit"),
    Criterion(
        CODES[2],
        "contact forces",
        "torque.force_residual",
        "of the weight",
        "residual force in Newton's second law with recorded contacts and pushes, worst mean over 0.5 s",
    ),
)
def recorded_forces(motion: Motion, settings: TorqueSettings) -> tuple[Result, ...]:
    """Verdicts on a rollout's torques and contact forces; skipped for a motion without simulated forces."""
    forces = motion.clip.forces
    if forces is None:
        return tuple(Skipped(code=code, not_applicable=NO_FORCES) for code in CODES)
    limit = "the motor of {joint} is at its torque limit"
    saturated = share_and_run(
        (CODES[0], CODES[1]),
        np.abs(forces.joint_torque) / motion.robot.torque_limit > settings.saturation,
        (settings.saturation_share, settings.saturation_run_s),
        motion,
        (
            f"{limit} in {{percent:.1f}} % of the frames",
            f"from {{start_s:.2f}} s on {limit} for {{run_s:.2f}} s without a break",
        ),
    )
    return (*saturated, _force_residual(motion, forces, settings))


def _force_residual(motion: Motion, forces: SimulatedForces, settings: TorqueSettings) -> Verdict:
    residual = unexplained_force(motion, forces)
    width = odd_width(settings.residual_window_s, motion.clip.fps)
    mean = np.linalg.norm(windowed_mean(residual, width), axis=1) / (motion.robot.total_mass * GRAVITY)
    frame = int(np.argmax(mean))
    return Verdict(
        code=CODES[2],
        value=float(mean[frame]),
        limit=settings.force_residual,
        text=f"around {frame / motion.clip.fps:.2f} s the recorded contact forces do not explain the motion: "
        f"{100 * mean[frame]:.0f} % of the weight is missing",
        bad=mean > settings.force_residual,
    )


def unexplained_force(motion: Motion, forces: SimulatedForces) -> Float[np.ndarray, "t 3"]:
    """Newton's second law at the centre of mass: m a minus weight, contact forces and pushes [N].

    The acceleration is the second difference of the centre of mass over three frames, which weights the forces of the
    control steps before and after the middle frame equally. The first and last frame repeat their neighbour.
    """
    clip, mass = motion.clip, motion.robot.total_mass
    com = centre_of_mass(motion.robot, clip.root_pos_w, clip.root_quat_w, clip.joint_pos)
    acceleration = (com[2:] - 2.0 * com[1:-1] + com[:-2]) * clip.fps**2
    force = forces.foot_wrench_w[..., :3].sum(axis=1) + forces.other_force_w + forces.push_w
    mean = 0.5 * (force[1:-1] + force[:-2])
    inner = mass * acceleration - mean + np.array([0.0, 0.0, mass * GRAVITY])
    if len(inner) == 0:
        return np.zeros((clip.frame_count, 3))
    return np.concatenate([inner[:1], inner, inner[-1:]])


def centre_of_mass(
    robot: Robot,
    root_pos_w: Float[np.ndarray, "t 3"],
    root_quat_w: Float[np.ndarray, "t 4"],
    joint_pos: Float[np.ndarray, "t j"],
) -> Float[np.ndarray, "t 3"]:
    """Centre of mass of the robot [m], world frame."""
    mass, com_b = _link_masses(robot.mjcf)
    poses = Kinematics(robot).forward(root_pos_w, root_quat_w, joint_pos)
    com_w = poses.pos_w + rotation.rotate(poses.quat_w, com_b)
    return np.einsum("l,tlx->tx", mass / mass.sum(), com_w)


@functools.lru_cache(maxsize=8)
def _link_masses(mjcf: str) -> tuple[np.ndarray, np.ndarray]:
    """Mass [kg] (l,) and centre of mass in the link frame [m] (l, 3) of each link of a model."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    return model.body_mass[1:].copy(), model.body_ipos[1:].copy()
