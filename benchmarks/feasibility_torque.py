"""Torque by inverse dynamics against the motors' torque of a simulation, wherever the ground's forces come from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from benchmarks.report import Bar
from pipeline.quality.sole import sole_motion
from pipeline.robot import Kinematics, Robot
from pipeline.simulation.contact_wrench import solve_contacts
from pipeline.simulation.inverse_dynamics import StateSeries, motion_forces, states
from pipeline.simulation.rollout import Rollout
from tests.factories.policy_walks import policy_walk

COMMANDS = ((0.4, 0.0, 0.0), (0.8, 0.0, 0.0), (1.4, 0.0, 0.0), (0.0, 0.3, 0.0), (0.3, 0.0, 0.8))
SECONDS, START_S = 5.0, 2.0
"""Length of a walk and what is left out of its start, where it sets off [s]."""
JUDGED_HZ, CUTOFF_HZ = 50.0, 10.0
"""Rate and low pass at which KP5 looks at a motion."""
MOST_ERROR_NM, MOST_PERCENT = 1e-6, 2.0


def torque_bars(policies: Path, robot: Robot) -> list[Bar]:
    """Errors over some walks: largest with the simulation's own contact forces, root mean square with solved ones."""
    walks = [policy_walk(policies, robot, command, SECONDS) for command in COMMANDS]
    errors = np.concatenate([own_force_errors(walk, robot) for walk in walks])
    whole = errors[:, 0] <= MOST_ERROR_NM
    largest = float(errors[whole, 1].max())
    bars = [
        Bar(name="torque, the simulation's own forces", value=largest, unit="N m", sense="<=", bound=MOST_ERROR_NM),
        Bar(name="frames whose forces do not add up at the root", value=100.0 * float(np.mean(~whole)), unit="%"),
        Bar(name="torque in those frames", value=float(errors[~whole, 1].max(initial=0.0)), unit="N m"),
    ]
    for rate, fps in (("physics rate", round(1.0 / walks[0].timestep_s)), ("50 Hz", JUDGED_HZ)):
        errors = [solved(walk, robot, float(fps)) for walk in walks]
        for support, feet in (("single", 1), ("double", 2)):
            percent = _percent([(error[on == feet], true[on == feet]) for error, true, on in errors])
            held = rate == "physics rate" and feet == 1
            bound = {"sense": "<=", "bound": MOST_PERCENT} if held else {}
            bars.append(Bar(name=f"torque, solved forces, {support} support, {rate}", value=percent, unit="%", **bound))
    return bars


def _percent(parts: list[tuple[np.ndarray, np.ndarray]]) -> float:
    """Root mean square of all errors over that of all torques [%]."""
    error, true = (np.concatenate([part[index] for part in parts]) for index in range(2))
    return 100.0 * float(np.sqrt(np.mean(error**2) / np.mean(true**2)))


def own_force_errors(walk: Rollout, robot: Robot) -> Float[np.ndarray, "t 2"]:
    """Largest difference of each frame where the wrench at each foot is the simulation's: force at the root [N], where
    no motor is, and torque [N m].

    In a few frames the simulator's solver stops before acceleration and contact forces agree; that shows at the root.
    """
    assert walk.qacc is not None
    found = motion_forces(robot, StateSeries(qpos=walk.qpos, qvel=walk.qvel, qacc=walk.qacc))
    poses = Kinematics(robot).forward(walk.qpos[:, :3], walk.qpos[:, 3:7], walk.qpos[:, 7:])
    torque = found.joint_torque.copy()
    for side, name in enumerate(("left", "right")):
        foot = robot.link(robot.human[f"{name}_foot"])
        force, moment = walk.foot_wrench_w[:, side, :3], walk.foot_wrench_w[:, side, 3:]
        for joint in _joints_above(robot, foot):
            lever_w = poses.pos_w[:, foot] - found.joint_anchor_w[:, joint]
            torque[:, joint] -= np.sum(found.joint_axis_w[:, joint] * (moment + np.cross(lever_w, force)), axis=1)
    missing = np.abs(found.root_wrench_w[:, :3] - walk.foot_wrench_w[:, :, :3].sum(axis=1)).max(axis=1)
    return np.stack([missing, np.abs(torque - walk.torque).max(axis=1)], axis=1)


def _joints_above(robot: Robot, link: int) -> list[int]:
    """Joints between the root and a link."""
    joints = []
    while robot.tree.parent[link] >= 0:
        joints.append(int(robot.tree.joint[link]))
        link = int(robot.tree.parent[link])
    return joints


def solved(
    walk: Rollout, robot: Robot, fps: float
) -> tuple[Float[np.ndarray, "t j"], Float[np.ndarray, "t j"], Float[np.ndarray, " t"]]:
    """Error and true torque [N m], and how many feet stand, with forces sought for the motion at a rate."""
    assert walk.qacc is not None
    clip = walk.clip("walk", fps, START_S)
    assert clip.contacts is not None
    step = round(1.0 / walk.timestep_s / fps)
    frames = slice(round(START_S / walk.timestep_s), None, step)
    true = walk.torque[frames][: clip.frame_count]
    if step == 1:
        series = StateSeries(qpos=walk.qpos[frames], qvel=walk.qvel[frames], qacc=walk.qacc[frames])
    else:
        series = states(clip.root_pos_w, clip.root_quat_w, clip.joint_pos, fps, CUTOFF_HZ)
    corners_w = sole_motion(clip, robot).corner_pos_w
    touching: Bool[np.ndarray, "t 2 4"] = np.broadcast_to(clip.contacts[:, :, None], corners_w.shape[:3])
    forces = motion_forces(robot, series)
    found = solve_contacts(robot, forces, clip.root_pos_w, corners_w, touching, friction=1.0, excess_weight=0.1)
    return found.joint_torque - true, true, clip.contacts.sum(axis=1)
