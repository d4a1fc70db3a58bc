"""The paper's environment on mjlab: its step, in parts that a GPU replays, and the windows the discriminator reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
import warp as wp
from mjlab.envs import ManagerBasedRlEnv

from pipeline.learning.plain_simulation import PlainSimulation
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import Bundle
from pipeline.training.captured import Captured
from pipeline.training.commands import VelocityCommand
from pipeline.training.curves import Record
from pipeline.training.double_stance import DoubleStance
from pipeline.training.environment_cfg import DECIMATION, environment_cfg
from pipeline.training.expert_sampling import ReferenceStates
from pipeline.training.initial_state import write_starts
from pipeline.training.leg_swings import ClipSwings, LegSwings
from pipeline.training.masks import members, replace
from pipeline.training.motion_features import state_features, window_frames, window_span
from pipeline.training.observations import LARGEST
from pipeline.training.options import Options
from pipeline.training.power_excess import PowerExcess
from pipeline.training.pushes import ComingPush
from pipeline.training.ramps import Ramps
from pipeline.training.readings import Readings
from pipeline.training.reward_terms import motor_limit
from pipeline.training.slopes import Slopes
from pipeline.training.step_times import StepTimes
from pipeline.training.tracked_clip import TrackedClip
from pipeline.training.trunk_forces import TrunkForces
from pipeline.training.trunk_lean import TrunkLean

VELOCITY_STEPS = 8
"""Velocities are recorded at every so many steps."""


def chosen_physics(device: str, asked: str | None) -> str:
    """`warp` on a GPU; on a processor `plain`, which is the faster there, if nothing else is asked for.

    Raises TrainingError for `plain` on a GPU.
    """
    if asked == "plain" and device != "cpu":
        raise TrainingError(f"--physics is 'plain', which steps on a processor, and --device '{device}'.")
    return asked or ("plain" if device == "cpu" else "warp")


@dataclass(frozen=True, kw_only=True)
class Context:
    """What the environment's terms read besides the simulation."""

    bundle: Bundle
    options: Options
    references: ReferenceStates


class AmpEnvironment(ManagerBasedRlEnv):
    """mjlab's environment with the readings of `Readings` and, in `extras`, the discriminator's windows."""

    def __init__(
        self, bundle: Bundle, options: Options, num_envs: int, device: str, seed: int, physics: str | None = None
    ):
        robot = bundle.robot
        self.physics = chosen_physics(device, physics)
        references = ReferenceStates(bundle.expert, options, seed, device)
        self.context = Context(bundle=bundle, options=options, references=references)
        self.policy_index = torch.from_numpy(robot.index(robot.policy_joints)).to(device)
        self.controlled_index = torch.from_numpy(robot.index(robot.controlled)).to(device)
        self.default_joint_pos = torch.from_numpy(robot.default_joint_pos).float().to(device)
        self.effort_limit = torch.from_numpy(robot.effort_limit).float().to(device)
        self._stall_torque, self._no_load_speed = (
            torch.from_numpy(np.nan_to_num(values, nan=np.inf)).float().to(device)
            for values in (robot.saturation_effort, robot.no_load_speed)
        )
        self.fell = torch.zeros(num_envs, dtype=torch.bool, device=device)
        self.stalled = torch.zeros(num_envs, dtype=torch.bool, device=device)
        self.quiet = torch.arange(num_envs, device=device) < round(options.quiet_share * num_envs)
        """Environments without noise."""
        unpushed = round((1.0 - options.quiet_pushed) * options.quiet_share * num_envs)
        self.pushed = torch.arange(num_envs, device=device) >= unpushed
        """Environments with pushes."""
        self.schedule: float | None = None
        """The iteration that schedules are at, where they don't go by the environment's own steps."""
        self.ended_steps = torch.zeros(num_envs, dtype=torch.long, device=device)
        """Length of each environment's last episode."""
        self.step_times = StepTimes(bundle.expert, device)
        self.trunk_lean = TrunkLean(bundle.expert, device)
        self.clip_double_stance = DoubleStance(bundle.expert, robot, device) if options.double_stance else None
        self.clip_swings = ClipSwings(bundle.expert, robot.controlled, device) if options.full_swing else None
        self.own_command = torch.full((num_envs, 3), torch.nan, device=device)
        """The command that goes with what an episode began at; NaN where none does."""
        self.begun_command = torch.zeros(num_envs, 3, device=device)
        """The command that the robot obeyed as its episode began (n, 3)."""
        self.rotor_link_share = torch.zeros(num_envs, device=device)
        """Share of the rotors' inertia that is on the links (n,)."""
        self.ramps = Ramps(options, device)
        self.restarts: list[Callable[[torch.Tensor], None]] = []
        """What terms do where (n,) an episode begins; each puts its own in."""
        self.coming_pushes: list[ComingPush] = []
        """Of each kind of push the next ones; each kind puts its own in."""
        if device == "cpu":
            wp.config.optimization_level = 0  # on a CPU Warp only tries training: kernels that compile soon count more
        super().__init__(environment_cfg(robot, options, num_envs, seed), device)
        self._given = torch.zeros_like(self.action_manager.action)
        # who reads more than the state as motors are told their targets, or as a sensor is updated, must count here
        states_suffice = isinstance(self.sim, PlainSimulation) and not self.trunk_forces.helps
        self._step_between = self.sim.step_between if states_suffice else self.sim.step

        def part(work: Callable[[], None]) -> Captured:
            return Captured(work, device, options.captured)

        self._aims = (part(self._aim_first), *(part(self._aim_again) for _ in range(DECIMATION - 1)))
        self._judge = part(self._judge_state)
        self._begin = part(lambda: self._begin_episodes(self.reset_buf))
        self._see = part(self._see_state)
        self._note = part(self._note_velocity)

    def load_managers(self) -> None:
        """mjlab's managers; the readings must be there before, the windows' size is known after."""
        robot, options = self.context.bundle.robot, self.context.options
        if self.physics == "plain":
            self.sim = PlainSimulation(self.sim)
        self.slopes = Slopes(self) if options.slope_share else None
        self.readings = Readings(self, robot.feet, (*robot.hands, *robot.feet))
        self.joint_limits = tuple(self.scene["robot"].data.joint_pos_limits[0].unbind(dim=1))
        size = 18 + 2 * len(self.controlled_index) + (3 if options.discriminator_command else 0)
        self._motion = torch.zeros(self.num_envs, window_span(options), size, device=self.device)
        self.record = Record(self.device)
        self.trunk_forces = TrunkForces(self)
        self.tracked_clip = TrackedClip(self) if options.tracked else None
        self.leg_swings = LegSwings(self) if options.full_swing else None
        if self.leg_swings is not None:
            self.restarts.append(self.leg_swings.restart)
        self.power_excess = PowerExcess(self) if options.power_free else None
        if self.power_excess is not None:
            self.restarts.append(self.power_excess.restart)
        super().load_managers()

    @property
    def command(self) -> torch.Tensor:
        """The velocity command (n, 3)."""
        return self.velocity_command.command

    @property
    def velocity_command(self) -> VelocityCommand:
        """The term that keeps it."""
        return cast(VelocityCommand, self.command_manager.get_term("velocity"))

    def iteration(self) -> float:
        """How many iterations of training the environment has lived through, or what the schedule says instead."""
        lived = self.common_step_counter / self.context.options.steps
        return lived if self.schedule is None else self.schedule

    def go_on(self) -> None:
        """Ramps and slopes go to the iteration that it is."""
        iteration = self.iteration()
        self.ramps.at(iteration)
        if self.slopes is not None:
            self.slopes.at(iteration)

    def motor_limit(self, of: str) -> torch.Tensor:
        """The motors' constant `limit`, or what the `line` leaves of it at their speed [N m]."""
        read = self.readings
        if of == "limit" or self.context.options.motors == "box":
            return self.effort_limit
        return motor_limit(read.torque, read.joint_vel, self.effort_limit, self._stall_torque, self._no_load_speed)

    @property
    def tracked_velocity(self) -> torch.Tensor:
        """Velocity (n, 3) that is held against the command."""
        mean = self.context.options.tracking_of == "mean"
        return self.readings.mean_velocity if mean else self.readings.velocity

    def step(self, action: torch.Tensor):
        """mjlab's step in parts that a GPU replays; `extras` gets `motion` (n, h, f) and `motion_valid` (n,): windows
        within one episode.

        Episodes end and begin by masks, never by indices. As in mjlab, rewards and terminations see links as they were
        a physics step ago. Observations are the caller's; all else that is returned is written over by the next step.
        """
        self.extras["log"] = {}
        self.go_on()
        self._given.copy_(action)
        for aim in self._aims:
            self._sim_step_counter += 1
            aim()
            if aim is self._aims[-1]:
                self.sim.step()
            else:
                self._step_between()
            self.scene.update(dt=self.physics_dt)
        self.common_step_counter += 1
        self._judge()
        self.sim.reset(self.reset_buf)
        self._begin()
        self.sim.forward()
        self._see()
        if self.common_step_counter % VELOCITY_STEPS == 0:
            self._note()
        self.readings.fresh()
        self.obs_buf = {name: seen.clone() for name, seen in self._seen.items()}  # the next step writes over them
        return self.obs_buf, self.reward_buf, self.reset_terminated, self.reset_time_outs, self.extras

    def _aim_first(self) -> None:
        self.action_manager.process_action(self._given)
        if not self.trunk_forces.helps:
            self.trunk_forces.write()
        self._aim_again()

    def _aim_again(self) -> None:
        self.action_manager.apply_action()
        if self.trunk_forces.helps:
            self.trunk_forces.write()
        self.scene.write_data_to_sim()

    def _judge_state(self) -> None:
        """Ends, rewards and pushes."""
        self.episode_length_buf += 1
        self.reset_buf = self.termination_manager.compute()
        self.reset_terminated = self.termination_manager.terminated
        self.reset_time_outs = self.termination_manager.time_outs & ~self.reset_terminated
        self.reward_buf = self.reward_manager.compute(dt=self.step_dt)
        if "step" in self.event_manager.available_modes:
            self.event_manager.apply(mode="step", dt=self.step_dt)

    def _begin_episodes(self, mask: torch.Tensor) -> None:
        """Everything that an episode begins with, of those (n,) whose simulation has been reset.

        In place of mjlab's managers, which reset by indices. Its scene is left out: motors and sensors here keep no
        state, and targets are written before the next physics step.
        """
        replace(self.ended_steps, mask, self.episode_length_buf)
        write_starts(self, mask)
        for state in (self.action_manager.action, self.action_manager.prev_action):
            replace(state, mask, 0.0)
        for restart in self.restarts:
            restart(mask)
        replace(self.episode_length_buf, mask, 0)

    def _see_state(self) -> None:
        """Commands grow older, then what is seen of the state and kept of it."""
        self.command_manager.compute(dt=self.step_dt * ~self.reset_buf)
        self._seen = self.observation_manager.compute(update_history=True)
        self._motion.copy_(torch.cat([self._motion[:, 1:], self.motion_features()[:, None]], dim=1))
        self.extras["motion"] = window_frames(self._motion, self.context.options)
        self.extras["motion_valid"] = self.episode_length_buf >= self._motion.shape[1]
        self.record.add(self)

    def _note_velocity(self) -> None:
        self.readings.fresh()
        self.record.add_velocity(self)

    def get_observations(self) -> dict:
        """What the last step returned, not the memory that the next one writes over."""
        return self.obs_buf

    def motion_features(self) -> torch.Tensor:
        """Features of the current states (n, f), with the command where the discriminator sees it."""
        read, index = self.readings, self.controlled_index
        values = state_features(
            read.root_pos_w,
            read.root_rotation_w,
            read.lin_vel_b,
            read.ang_vel_b,
            read.joint_pos[:, index],
            read.joint_vel[:, index],
            read.ends_pos_w,
        )
        if self.context.options.discriminator_command:
            values = torch.cat([values, self.command], dim=1)
        return torch.nan_to_num(values).clamp(-LARGEST, LARGEST)

    def _reset_idx(self, env_ids: torch.Tensor | None = None) -> None:
        assert env_ids is not None
        self.sim.reset(env_ids)
        self._begin_episodes(members(env_ids, self.num_envs))
