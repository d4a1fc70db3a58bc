"""The mjlab environment: its step in parts captured as CUDA graphs, and the discriminator's motion windows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast, runtime_checkable

import numpy as np
import torch
import warp as wp
from mjlab.envs import ManagerBasedRlEnv

from pipeline.learning.plain_simulation import PlainSimulation
from pipeline.learning.training_error import TrainingError
from pipeline.training.amp.expert import KEPT_STARTS_SHARE, sample_frames
from pipeline.training.amp.features import floors, positions, state_features
from pipeline.training.bundle import FPS, Bundle
from pipeline.training.captured import Captured
from pipeline.training.config import AFTER_CHANGE_S, Config
from pipeline.training.curves import Record
from pipeline.training.environment_cfg import DECIMATION, environment_cfg
from pipeline.training.masks import mask_of_indices, replace
from pipeline.training.mdp.commands import VelocityCommand
from pipeline.training.mdp.events import Slopes
from pipeline.training.mdp.observations import OBSERVATION_LIMIT
from pipeline.training.mdp.start_states import StartStates, expert_states, write_starts
from pipeline.training.robot_state import RobotState
from pipeline.training.terrain import ROUGHNESS_M

VELOCITY_STEPS = 8
"""Control steps between two records of the velocities."""
AFTER_CHANGE_STEPS = round(AFTER_CHANGE_S * FPS)


@runtime_checkable
class FollowedClips(Protocol):
    """Interface of the reference clips that distillation follows (`distillation/teacher.py`)."""

    command: torch.Tensor
    tracking_failed: torch.Tensor
    clip_ended: torch.Tensor

    def begin(self, env: AmpEnvironment, mask: torch.Tensor, frame: torch.Tensor, yaw: torch.Tensor) -> None: ...

    def advance(self, env: AmpEnvironment) -> None: ...


@dataclass(frozen=True, kw_only=True)
class Context:
    """Constant data that the environment's terms read besides the simulation."""

    bundle: Bundle
    config: Config
    starts: StartStates


def chosen_physics(device: str, given: str | None) -> str:
    """Select the physics engine: `given`, else `warp` on a GPU and `plain`, which is faster, on a CPU.

    Raises TrainingError for `plain` on a GPU.
    """
    if given == "plain" and device != "cpu":
        raise TrainingError(f"--physics is 'plain', which runs only on a CPU, but --device is '{device}'.")
    return given or ("plain" if device == "cpu" else "warp")


class AmpEnvironment(ManagerBasedRlEnv):
    """mjlab's environment with `RobotState` and, in `extras`, the discriminator's motion windows."""

    def __init__(
        self,
        bundle: Bundle,
        config: Config,
        device: str,
        seed: int,
        physics: str | None = None,
        captured: bool = True,
        teacher: FollowedClips | None = None,
        starts: StartStates | None = None,
    ):
        """
        Args:
            bundle: robot and expert
            config: configuration of the run
            device: `cpu` or a GPU
            seed: random seed
            physics: `warp` or `plain`; None: the faster one on the device
            captured: whether to replay the step as CUDA graphs on a GPU; the result is identical
            teacher: reference clips to follow, in distillation
            starts: start states of episodes; None: expert frames
        """
        robot, num_envs = bundle.robot, config.simulation.num_envs
        self.physics = chosen_physics(device, physics)
        self.teacher = teacher
        self.policy_index = torch.from_numpy(robot.index(robot.policy_joints)).to(device)
        self.controlled_index = torch.from_numpy(robot.index(robot.controlled)).to(device)
        self.default_joint_pos = torch.from_numpy(robot.default_joint_pos).float().to(device)
        self.effort_limit = torch.from_numpy(robot.effort_limit).float().to(device)
        self.stall_torque, self.no_load_speed = (
            torch.from_numpy(np.nan_to_num(values, nan=np.inf)).float().to(device)
            for values in (robot.saturation_effort, robot.no_load_speed)
        )
        self.context = Context(
            bundle=bundle, config=config, starts=starts or self._expert_starts(bundle, config, device, seed)
        )
        self.ground_m = ROUGHNESS_M if config.simulation.terrain == "rough" else 0.0
        """Height of the highest ground [m]."""
        self.ended_steps = torch.zeros(num_envs, dtype=torch.long, device=device)
        """Length of each environment's last episode [control steps] (n,)."""
        self.start_command = torch.full((num_envs, 3), torch.nan, device=device)
        """Command of the episode's start state (n, 3); NaN where the command is sampled."""
        self.start_velocity = torch.zeros(num_envs, 3, device=device)
        """Velocity of the episode's start state (n, 3)."""
        self.push_w = torch.zeros(num_envs, 3, device=device)
        """Push force on the trunk (n, 3) [N]."""
        self.steps_since_push = torch.full((num_envs,), AFTER_CHANGE_STEPS, device=device)
        """Control steps since the episode's last push or kick began (n,); AFTER_CHANGE_STEPS or more without one."""
        self.disturbance = torch.zeros((), device=device)
        """Ramp of delays, slopes and pushes, 0 to 1; on the device, because CUDA graphs read it."""
        self.final = torch.zeros((), device=device)
        """Ramp of the power penalty, 0 to 1."""
        self.restarts: list[Callable[[torch.Tensor], None]] = []
        """Reset functions of the terms; the argument is the mask (n,) of environments that begin an episode."""
        if device == "cpu":
            wp.config.optimization_level = 0  # tests and trials need fast compilation more than fast kernels
        super().__init__(environment_cfg(robot, config, seed, teacher is not None), device)
        self._policy_action = torch.zeros_like(self.action_manager.action)
        plain = isinstance(self.sim, PlainSimulation)
        self._step_between = self.sim.step_between if plain else self.sim.step  # motors read only qpos and qvel

        def part(function: Callable[[], None]) -> Captured:
            return Captured(function, device, captured)

        self._targets = (part(self._first_targets), *(part(self._write_targets) for _ in range(DECIMATION - 1)))
        self._evaluate = part(self._terminate_and_reward)
        self._reset_done = part(lambda: self._begin_episodes(self.reset_buf))
        self._update_observations = part(self._observe)
        self._update_velocity = part(self._record_velocity)

    @staticmethod
    def _expert_starts(bundle: Bundle, config: Config, device: str, seed: int) -> StartStates:
        expert, robot = bundle.expert, bundle.robot
        drawn, _, kept = sample_frames(expert, np.arange(len(expert.frames)), config, seed, KEPT_STARTS_SHARE)
        return expert_states(expert, drawn, kept, robot.index(robot.controlled), robot.default_joint_pos, device)

    def load_managers(self) -> None:
        """Create the state that the terms read, then mjlab's managers."""
        robot, config = self.context.bundle.robot, self.context.config
        if self.physics == "plain":
            self.sim = PlainSimulation(self.sim)
        self.slopes = Slopes(self)
        self.slopes.set_scale(0.0)
        self.robot_state = RobotState(self, robot.feet, (*robot.hands, *robot.feet))
        self.joint_limits = tuple(self.scene["robot"].data.joint_pos_limits[0].unbind(dim=1))
        (trunk,), _ = self.scene["robot"].find_bodies(robot.root_link)
        self._trunk = slice(trunk, trunk + 1)  # a slice, because an index list would be copied to the GPU at each step
        self._no_torque = torch.zeros_like(self.push_w)[:, None]
        self.restarts.append(lambda mask: replace(self.push_w, mask, 0.0))
        self.restarts.append(lambda mask: replace(self.steps_since_push, mask, AFTER_CHANGE_STEPS))
        self._with_command = config.discriminator.by_command
        size = len(floors(len(robot.controlled))) + 3 * self._with_command
        self._motion = torch.zeros(self.num_envs, config.discriminator.frames, size, device=self.device)
        self._positions = self.positions()[:, None].repeat(1, 3, 1)  # last three steps, the newest last
        super().load_managers()
        self.record = Record(self.device, self.reward_manager.active_terms)

    @property
    def command(self) -> torch.Tensor:
        """The velocity command (n, 3)."""
        return self.velocity_command.command

    @property
    def velocity_command(self) -> VelocityCommand:
        """The command term."""
        return cast(VelocityCommand, self.command_manager.get_term("velocity"))

    def set_disturbance(self, share: float) -> None:
        """Set delays, slopes and pushes to a share (0 to 1) of their maximum."""
        self.disturbance.fill_(share)
        self.slopes.set_scale(share)

    def step(self, action: torch.Tensor):
        """Step as mjlab does, in captured parts. `extras` gets the motion windows `motion` (n, h, f), and
        `motion_valid` (n,): within one episode, not soon after a push nor, with `by_command`, after a new command.

        Resets use masks, never indices. As in mjlab, rewards and terminations read link poses that are one physics step
        old. Observations are copies; the next step overwrites all other returned tensors.
        """
        self.extras["log"] = {}
        self._policy_action.copy_(action)
        for targets in self._targets:
            self._sim_step_counter += 1
            targets()
            if targets is self._targets[-1]:
                self.sim.step()
            else:
                self._step_between()
            self.scene.update(dt=self.physics_dt)
        self.common_step_counter += 1
        self._evaluate()
        self.sim.reset(self.reset_buf)
        self._reset_done()
        self.sim.forward()
        self._update_observations()
        if self.common_step_counter % VELOCITY_STEPS == 0:
            self._update_velocity()
        self.robot_state.invalidate()
        self.obs_buf = {name: group.clone() for name, group in self._groups.items()}  # next step overwrites
        return self.obs_buf, self.reward_buf, self.reset_terminated, self.reset_time_outs, self.extras

    def _first_targets(self) -> None:
        self.action_manager.process_action(self._policy_action)
        self.scene["robot"].write_external_wrench_to_sim(self.push_w[:, None], self._no_torque, body_ids=self._trunk)
        self._write_targets()

    def _write_targets(self) -> None:
        self.action_manager.apply_action()
        self.scene.write_data_to_sim()

    def _terminate_and_reward(self) -> None:
        """Compute terminations and rewards, and apply pushes."""
        self.robot_state.advance()
        if self.teacher is not None:
            self.teacher.advance(self)
        self.episode_length_buf += 1
        self.reset_buf = self.termination_manager.compute()
        self.reset_terminated = self.termination_manager.terminated
        self.reset_time_outs = self.termination_manager.time_outs & ~self.reset_terminated
        self.reward_buf = self.reward_manager.compute(dt=self.step_dt)
        self.steps_since_push += 1
        if "step" in self.event_manager.available_modes:
            self.event_manager.apply(mode="step", dt=self.step_dt)

    def _begin_episodes(self, mask: torch.Tensor) -> None:
        """Begin episodes in the environments of `mask` (n,), whose simulation has been reset.

        Replaces the reset of mjlab's managers, which needs indices. The scene needs no reset: motors and sensors are
        stateless here, and targets are written before the next physics step.
        """
        replace(self.ended_steps, mask, self.episode_length_buf)
        write_starts(self, mask)
        for state in (self.action_manager.action, self.action_manager.prev_action):
            replace(state, mask, 0.0)
        for restart in self.restarts:
            restart(mask)
        replace(self.episode_length_buf, mask, 0)

    def _observe(self) -> None:
        """Update commands, observations, motion windows and metrics. mjlab's `reset` records no positions."""
        self.command_manager.compute(dt=self.step_dt * ~self.reset_buf)
        self._groups = self.observation_manager.compute(update_history=True)
        self._positions.copy_(torch.cat([self._positions[:, 1:], self.positions()[:, None]], dim=1))
        self._motion.copy_(torch.cat([self._motion[:, 1:], self.motion_features()[:, None]], dim=1))
        self.extras["motion"] = self._motion
        whole, quiet = self.episode_length_buf > self._motion.shape[1] + 1, self.steps_since_push >= AFTER_CHANGE_STEPS
        self.extras["motion_valid"] = whole & quiet
        if self._with_command:
            constant = (self._motion[:, 0, -3:] == self.command).all(dim=1)
            self.extras["motion_valid"] &= constant & (self.velocity_command.age >= AFTER_CHANGE_S)
        self.record.add(self)

    def _record_velocity(self) -> None:
        self.robot_state.invalidate()
        self.record.add_velocity(self)

    def get_observations(self) -> dict:
        """The observations of the last step, as copies that the next step does not overwrite."""
        return self.obs_buf

    def positions(self) -> torch.Tensor:
        """Current `positions` for the discriminator's features (n, 24 + a)."""
        state, joint_pos = self.robot_state, self.robot_state.joint_pos[:, self.controlled_index]
        return positions(state.root_pos_w, state.root_rotation_w, joint_pos, state.ends_pos_w)

    def motion_features(self) -> torch.Tensor:
        """Discriminator input for the state one step ago (n, f): features and, with `by_command`, the command."""
        motion = torch.nan_to_num(state_features(self._positions)).clamp(-OBSERVATION_LIMIT, OBSERVATION_LIMIT)
        return torch.cat([motion, self.command], dim=1) if self._with_command else motion

    def _reset_idx(self, env_ids: torch.Tensor | None = None) -> None:
        assert env_ids is not None
        self.sim.reset(env_ids)
        self._begin_episodes(mask_of_indices(env_ids, self.num_envs))
