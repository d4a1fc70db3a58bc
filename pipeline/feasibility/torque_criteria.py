"""Criteria of the forces that a simulation recorded: motor saturation, and whether contacts explain the motion."""

from __future__ import annotations

import functools

import mujoco
import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.clips.robot_clip import SimulatedForces
from pipeline.feasibility.motion import Motion
from pipeline.feasibility.over_limit import over_limit
from pipeline.feasibility.torque_settings import TorqueSettings
from pipeline.feasibility.verdict import Verdict
from pipeline.feasibility.windowed_mean import odd_width, windowed_mean
from pipeline.robot import Kinematics, Robot

GRAVITY = 9.81
"""[m/s^2]"""


def recorded_forces(motion: Motion, settings: TorqueSettings) -> tuple[Verdict, ...]:
    """Verdicts on a rollout's torques and contact forces; none for a motion that no simulation made."""
    forces = motion.clip.forces
    if forces is None:
        return ()
    return (*_saturation(motion, forces, settings), _force_residual(motion, forces, settings))


def _saturation(motion: Motion, forces: SimulatedForces, settings: TorqueSettings) -> tuple[Verdict, Verdict]:
    """Share of a joint's frames with its motor at the limit, and the longest time without a break."""
    names = motion.robot.joint_names
    ratio = np.abs(forces.joint_torque) / motion.robot.torque_limit
    found = over_limit(ratio > settings.saturation, motion)
    most, largest = found.worst, motion.largest_share(settings.saturation_share)
    return (
        Verdict(
            code="torque_saturation_share",
            value=float(found.share[most]),
            limit=largest,
            unit="of frames",
            text=f"the motor of {names[most]} is at its torque limit in {100 * found.share[most]:.1f} % of the frames",
            bad=found.frames_of_joints_over(largest),
        ),
        Verdict(
            code="torque_saturation_run_s",
            value=found.longest_s,
            limit=settings.saturation_run_s,
            unit="s",
            text=f"from {found.start_s:.2f} s on the motor of {names[found.joint]} is at its torque limit for "
            f"{found.longest_s:.2f} s without a break",
            bad=found.frames_of_runs_over(settings.saturation_run_s),
        ),
    )


def _force_residual(motion: Motion, forces: SimulatedForces, settings: TorqueSettings) -> Verdict:
    residual = unexplained_force(motion, forces)
    width = odd_width(settings.residual_window_s, motion.clip.fps)
    mean = np.linalg.norm(windowed_mean(residual, width), axis=1) / (motion.robot.total_mass * GRAVITY)
    frame = int(np.argmax(mean))
    return Verdict(
        code="force_residual",
        value=float(mean[frame]),
        limit=settings.force_residual,
        unit="of the weight",
        text=f"around {frame / motion.clip.fps:.2f} s the recorded contact forces do not explain the motion: "
        f"{100 * mean[frame]:.0f} % of the weight is missing",
        bad=mean > settings.force_residual,
    )


def unexplained_force(motion: Motion, forces: SimulatedForces) -> Float[np.ndarray, "t 3"]:
    """Newton's second law at the centre of mass: m a minus weight, contact forces and pushes [N].

    The acceleration is the second difference of the centre of mass over three frames, which weighs the forces of the
    control steps before and after the middle frame alike. The first and last frame repeat their neighbour.
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
