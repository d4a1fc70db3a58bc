"""A rollout, and its recorder."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.robot_clip import RobotClip
from pipeline.robot import Robot
from pipeline.simulation.plant import PlantState

CLIP_FPS = 50.0


@dataclass(frozen=True, kw_only=True)
class Rollout:
    """n physics steps and k control steps of a robot. Torques and forces of a step act at its state."""

    robot: Robot
    timestep_s: float
    qpos: Float[np.ndarray, "n q"]
    """Root position (world), root quaternion wxyz, joints."""
    qvel: Float[np.ndarray, "n v"]
    """Root velocity (world), root angular velocity (root frame), joints."""
    torque: Float[np.ndarray, "n j"]
    """Applied motor torques [N m]."""
    foot_wrench_w: Float[np.ndarray, "n 2 6"]
    """Force [N] and moment about the foot link's origin [N m] of the ground on the left and right foot, world frame."""
    command: Float[np.ndarray, "k 3"]
    """Velocity command at each control step: forward, lateral [m/s], yaw rate [rad/s]."""
    target: Float[np.ndarray, "k j"]
    """Joint targets of each control step, in the robot's order [rad]."""
    fell_s: float | None
    """Time of the first fall [s]."""
    start_s: float = 0.0
    """Time of the first step [s]; not 0 if only the end of a run was recorded."""
    qacc: Float[np.ndarray, "n v"] | None = None
    """Accelerations in the layout of `qvel`; None if the engine does not provide them."""

    @property
    def fell(self) -> bool:
        return self.fell_s is not None

    @property
    def control_steps(self) -> int:
        """Number of physics steps per control step."""
        return len(self.qpos) // max(len(self.command), 1)

    def contacts(self) -> Bool[np.ndarray, "n 2"]:
        """Feet with a ground force above 1 N."""
        return self.foot_wrench_w[:, :, 2] > 1.0

    def clip(self, name: str, fps: float = CLIP_FPS, start_s: float = 0.0) -> RobotClip:
        """The rollout from `start_s` as a clip at `fps`, with the simulated contacts."""
        step = round(1.0 / (fps * self.timestep_s))
        taken = slice(round(start_s / self.timestep_s), None, step)
        root_pos_w, joint_pos = self.qpos[taken, :3].copy(), self.qpos[taken, 7:].copy()
        root_quat_w = rotation.make_continuous(self.qpos[taken, 3:7])
        return self.robot.clip(name, fps, root_pos_w, root_quat_w, joint_pos, contacts=self.contacts()[taken])


class Record:
    """Recorder of a rollout's arrays."""

    def __init__(self, first: int, last: int, decimation: int, joints: int):
        """From control step `first` to before `last`."""
        ticks = max(last - first, 0)
        count = ticks * decimation
        self.first, self.decimation = first, decimation
        self.qpos, self.qvel = np.empty((count, 7 + joints)), np.empty((count, 6 + joints))
        self.torque, self.foot_wrench_w = np.empty((count, joints)), np.empty((count, 2, 6))
        self.qacc: np.ndarray | None = None
        self.command, self.target = np.empty((ticks, 3)), np.empty((ticks, joints))
        self.steps = self.ticks = 0
        self.fall_tick: int | None = None

    @property
    def fell(self) -> bool:
        return self.fall_tick is not None

    def control(self, tick: int, command: np.ndarray, target: np.ndarray) -> None:
        tick -= self.first
        self.command[tick], self.target[tick] = command, target
        self.ticks = tick + 1

    def step(
        self, step: int, state: PlantState, torque: np.ndarray, wrench: np.ndarray, acceleration: np.ndarray | None
    ) -> None:
        step -= self.first * self.decimation
        qpos, qvel = self.qpos[step], self.qvel[step]
        qpos[:3], qpos[3:7], qpos[7:] = state.root_pos_w, state.root_quat_w, state.joint_pos
        qvel[:3], qvel[3:6], qvel[6:] = state.root_lin_vel_w, state.root_ang_vel_b, state.joint_vel
        self.torque[step], self.foot_wrench_w[step] = torque, wrench
        if acceleration is not None:
            if self.qacc is None:
                self.qacc = np.empty_like(self.qvel)
            self.qacc[step] = acceleration
        self.steps = step + 1

    def rollout(self, robot: Robot, timestep_s: float) -> Rollout:
        """The rollout recorded so far."""
        n, k = self.steps, self.ticks
        steps = {name: getattr(self, name)[:n] for name in ("qpos", "qvel", "torque", "foot_wrench_w")}
        fell_s = None if self.fall_tick is None else (self.fall_tick + 1) * self.decimation * timestep_s
        return Rollout(
            robot=robot,
            timestep_s=timestep_s,
            **steps,
            command=self.command[:k],
            target=self.target[:k],
            fell_s=fell_s,
            start_s=self.first * self.decimation * timestep_s,
            qacc=None if self.qacc is None else self.qacc[:n],
        )
