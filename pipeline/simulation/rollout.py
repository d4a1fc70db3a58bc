"""A policy walking in MuJoCo, recorded step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot, mujoco_model
from pipeline.simulation.pd_control import PdControl
from pipeline.simulation.policy import ACTION_SCALE, HISTORY, JOINT_ORDER, Policy

CONTROL_HZ = 50.0
COMMAND_SLEW = 1.0
"""How fast the command goes from standing to its value [m/s or rad/s a second]."""
FALL_HEIGHT = 0.45
"""Root height [m] below which the robot has fallen."""

Command = Callable[[float], Float[np.ndarray, " 3"]]


@dataclass(frozen=True, kw_only=True)
class Rollout:
    """N physics steps of a robot. Step n's torque and forces are those that act at its state."""

    robot: Robot
    timestep_s: float
    qpos: Float[np.ndarray, "n q"]
    """Root position (world), root quaternion wxyz, joints."""
    qvel: Float[np.ndarray, "n v"]
    """Root velocity (world), root angular velocity (root frame), joints."""
    qacc: Float[np.ndarray, "n v"]
    torque: Float[np.ndarray, "n j"]
    """What the motors gave [N m]."""
    foot_wrench_w: Float[np.ndarray, "n 2 6"]
    """Force [N] and moment about the foot link's origin [N m] of the ground on the left and right foot, world frame."""
    fell: bool

    def contacts(self, threshold: float = 1.0) -> Bool[np.ndarray, "n 2"]:
        """Feet pressed to the ground by more than `threshold` [N]."""
        return self.foot_wrench_w[:, :, 2] > threshold

    def clip(self, name: str, fps: float = CONTROL_HZ, start_s: float = 0.0) -> RobotClip:
        """Every k-th step from `start_s` on as a clip; contacts are the true ones."""
        step = round(1.0 / (fps * self.timestep_s))
        taken = slice(round(start_s / self.timestep_s), None, step)
        return RobotClip(
            name=name,
            fps=fps,
            robot=self.robot.name,
            joint_names=self.robot.joint_names,
            root_pos_w=self.qpos[taken, :3].copy(),
            root_quat_w=rotation.make_continuous(self.qpos[taken, 3:7]),
            joint_pos=self.qpos[taken, 7:].copy(),
            contacts=self.contacts()[taken],
        )


def rollout(
    robot: Robot, policy: Policy, control: PdControl, command: Command, seconds: float, timestep_s: float = 0.005
) -> Rollout:
    """Walk for `seconds` from the default pose; joints the policy doesn't have are held at their default.

    `command(t)` is the wanted forward and lateral velocity [m/s] and yaw rate [rad/s] at time t [s].
    """
    model = mujoco_model(robot, ground=True, timestep=timestep_s)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data = mujoco.MjData(model)
    data.qpos[:] = [0.0, 0.0, robot.default_root_height, 1.0, 0.0, 0.0, 0.0, *robot.default_joint_pos]
    mujoco.mj_forward(model, data)
    feet = [int(model.site_bodyid[model.site(name).id]) for name in robot.feet]
    order = [robot.joint_names.index(name) for name in JOINT_ORDER]
    memory = _Memory(robot, order)
    steps = round(seconds / timestep_s)
    decimation = round(1.0 / (CONTROL_HZ * timestep_s))
    target = np.array(robot.default_joint_pos)
    record: dict[str, list[np.ndarray]] = {name: [] for name in ("qpos", "qvel", "qacc", "torque", "foot_wrench_w")}
    fell = False
    for step in range(steps):
        if step % decimation == 0:
            action = policy.act(memory.observe(data, command(step * timestep_s)))
            memory.last_action = action
            target[order] = np.array(robot.default_joint_pos)[order] + ACTION_SCALE * action
        torque = control.torque(target, data.qpos[7:], data.qvel[6:])
        data.qfrc_applied[6:] = torque
        record["qpos"].append(data.qpos.copy())
        record["qvel"].append(data.qvel.copy())
        record["torque"].append(torque)
        mujoco.mj_step(model, data)  # accelerations, forces and poses of links are now those before the step
        record["qacc"].append(data.qacc.copy())
        record["foot_wrench_w"].append(_foot_wrench(model, data, feet))
        fell = fell or bool(data.qpos[2] < FALL_HEIGHT)
    arrays = {name: np.array(values) for name, values in record.items()}
    return Rollout(robot=robot, timestep_s=timestep_s, fell=fell, **arrays)


def steady_command(forward: float, lateral: float, yaw_rate: float) -> Command:
    """A command that is slewed from zero to its value and kept."""
    goal = np.array([forward, lateral, yaw_rate])
    return lambda time_s: np.clip(goal, -COMMAND_SLEW * time_s, COMMAND_SLEW * time_s)


class _Memory:
    """The observation history, which starts at zeros."""

    def __init__(self, robot: Robot, order: list[int]):
        self.default = np.array(robot.default_joint_pos)[order]
        self.order = np.array(order)
        self.last_action = np.zeros(len(order))
        self.history = np.zeros((HISTORY, 9 + 3 * len(order)))

    def observe(self, data: mujoco.MjData, command: np.ndarray) -> Float[np.ndarray, " n"]:
        gravity_b = rotation.rotate_inverse(data.qpos[3:7], np.array([0.0, 0.0, -1.0]))
        joints = data.qpos[7:][self.order] - self.default
        parts = [data.qvel[3:6], gravity_b, command, joints, data.qvel[6:][self.order], self.last_action]
        self.history = np.vstack([self.history[1:], np.concatenate(parts)])
        return self.history.ravel()


def _foot_wrench(model: mujoco.MjModel, data: mujoco.MjData, feet: list[int]) -> np.ndarray:
    """Ground's force and moment about the foot links' origins (2, 6). MuJoCo gives (moment, force) about the root's
    centre of mass."""
    mujoco.mj_rnePostConstraint(model, data)
    wrench = data.cfrc_ext[feet]
    force, moment = wrench[:, 3:], wrench[:, :3]
    arm = data.subtree_com[model.body_rootid[feet]] - data.xpos[feet]
    return np.concatenate([force, moment + np.cross(arm, force)], axis=1)
