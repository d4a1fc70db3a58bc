"""The paper's environment on mjlab: scene, terms and the windows that the discriminator reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
import warp as wp
from mjlab.envs import ManagerBasedRlEnv, ManagerBasedRlEnvCfg
from mjlab.envs.mdp import dr
from mjlab.managers.event_manager import EventTermCfg
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.scene import SceneCfg
from mjlab.sensor import ContactMatch, ContactSensorCfg
from mjlab.sim import MujocoCfg, SimulationCfg

from pipeline.training.action import PolicyActionCfg
from pipeline.training.bundle import Bundle, RobotFacts
from pipeline.training.commands import VelocityCommand, VelocityCommandCfg
from pipeline.training.curves import Record
from pipeline.training.expert_sampling import ReferenceStates
from pipeline.training.initial_state import begin_episodes
from pipeline.training.motion_features import state_features, window_frames, window_span
from pipeline.training.observations import LARGEST, observation_cfg
from pipeline.training.options import Options
from pipeline.training.pushes import PushForce, grown, push_velocity
from pipeline.training.readings import Readings
from pipeline.training.reward_table import reward_cfg
from pipeline.training.reward_terms import motor_limit, tracking
from pipeline.training.robot_entity import robot_entity
from pipeline.training.step_times import StepTimes
from pipeline.training.terminations import termination_cfg
from pipeline.training.terrain import terrain_cfg

PHYSICS_S = 0.005
DECIMATION = 4
OLD_S = 10.0
"""Age of the command of an episode that begins at the velocity it commands [s]: it may stall at once."""


@dataclass(frozen=True, kw_only=True)
class Context:
    """What the environment's terms read besides the simulation."""

    bundle: Bundle
    options: Options
    references: ReferenceStates


class AmpEnvironment(ManagerBasedRlEnv):
    """mjlab's environment with the readings of `Readings` and, in `extras`, the discriminator's windows."""

    def __init__(self, bundle: Bundle, options: Options, num_envs: int, device: str, seed: int):
        robot = bundle.robot
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
        self._kernels: torch.Tensor | None = None
        self.step_times = StepTimes(bundle.expert, device)
        self.own_command = torch.full((num_envs, 3), torch.nan, device=device)
        if device == "cpu":
            wp.config.optimization_level = 0  # a CPU only tries training: kernels that compile soon count more there
        super().__init__(environment_cfg(robot, options, num_envs, seed), device)

    def load_managers(self) -> None:
        """mjlab's managers; the readings must be there before, the windows' size is known after."""
        robot, options = self.context.bundle.robot, self.context.options
        self.readings = Readings(self, robot.feet, (*robot.hands, *robot.feet))
        self.joint_limits = tuple(self.scene["robot"].data.joint_pos_limits[0].unbind(dim=1))
        size = 18 + 2 * len(self.controlled_index) + (3 if options.discriminator_command else 0)
        self._motion = torch.zeros(self.num_envs, window_span(options), size, device=self.device)
        self.record = Record(self.device)
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

    def penalty_factor(self) -> float:
        """What penalties are multiplied by at this iteration."""
        options = self.context.options
        return grown((options.penalty_start, 1.0), self.iteration(), options.penalty_iterations)

    def late_factor(self) -> float:
        """What late rewards are multiplied by at this iteration."""
        first, last = self.context.options.late_iterations
        return min(1.0, max(0.0, (self.iteration() - first) / max(last - first, 1)))

    def motor_limit(self, of: str) -> torch.Tensor:
        """The motors' constant `limit`, or what the `line` leaves of it at their speed [N m]."""
        read = self.readings
        if of == "limit" or self.context.options.motors == "box":
            return self.effort_limit
        return motor_limit(read.torque, read.joint_vel, self.effort_limit, self._stall_torque, self._no_load_speed)

    def tracking_kernels(self) -> torch.Tensor:
        """How well the command is followed on each axis (n, 3), worked out once a step."""
        if self._kernels is None:
            sigma2 = self.context.options.sigma2
            self._kernels = tracking(self.command, self.tracked_velocity, sigma2)
        return self._kernels

    @property
    def tracked_velocity(self) -> torch.Tensor:
        """Velocity (n, 3) that is held against the command."""
        mean = self.context.options.tracking_of == "mean"
        return self.readings.mean_velocity if mean else self.readings.velocity

    def step(self, action: torch.Tensor):
        """mjlab's step; `extras` gets `motion` (n, h, f) and `motion_valid` (n,): windows within one episode."""
        self._kernels = None
        result = super().step(action)
        self.record.add(self)
        self._motion = torch.cat([self._motion[:, 1:], self.motion_features()[:, None]], dim=1)
        self.extras["motion"] = window_frames(self._motion, self.context.options)
        self.extras["motion_valid"] = self.episode_length_buf >= self._motion.shape[1]
        return result

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
        self.ended_steps[env_ids] = self.episode_length_buf[env_ids]
        super()._reset_idx(env_ids)
        self.velocity_command.keep(env_ids, self.own_command[env_ids], OLD_S)


def environment_cfg(robot: RobotFacts, options: Options, num_envs: int, seed: int) -> ManagerBasedRlEnvCfg:
    """The environment in mjlab's terms."""
    rough = options.terrain == "rough"
    return ManagerBasedRlEnvCfg(
        decimation=DECIMATION,
        episode_length_s=options.episode_s,
        seed=seed,
        scene=SceneCfg(
            num_envs=num_envs,
            terrain=terrain_cfg(options, seed),
            entities={"robot": robot_entity(robot, options)},
            sensors=_sensors(robot),
        ),
        sim=SimulationCfg(
            nconmax=60 if rough else 40,
            njmax=300 if rough else 200,
            mujoco=MujocoCfg(timestep=PHYSICS_S, iterations=10, ls_iterations=20),
        ),
        observations=observation_cfg(),
        actions={"joints": PolicyActionCfg(entity_name="robot")},
        commands={"velocity": VelocityCommandCfg(resampling_time_range=options.resample_s)},
        rewards=reward_cfg(),
        terminations=termination_cfg(options),
        events=_events(robot, options),
    )


def _sensors(robot: RobotFacts) -> tuple[ContactSensorCfg, ...]:
    touching = [shape for kind in ("shanks", "others") for shape in robot.shapes[kind]]

    def sensor(name: str, mode, pattern: tuple[str, ...]) -> ContactSensorCfg:
        return ContactSensorCfg(
            name=name,
            primary=ContactMatch(mode=mode, pattern=pattern, entity="robot"),
            fields=("force",),
            reduce="netforce",
        )

    feet = sensor("feet_contact", "body", tuple(f"^{link}$" for link in robot.foot_links))
    return feet, sensor("other_contact", "geom", tuple(f"^{shape}$" for shape in touching))


def _events(robot: RobotFacts, options: Options) -> dict[str, EventTermCfg]:
    feet = tuple(f"^{name}$" for name in robot.shapes["feet"])
    trunk = (f"^{robot.root_link}$",)
    events = {
        "friction": EventTermCfg(
            mode="startup",
            func=dr.geom_friction,
            params={
                "asset_cfg": SceneEntityCfg("robot", geom_names=feet),
                "operation": "abs",
                "ranges": options.friction,
                "shared_random": True,
            },
        ),
        "gains": EventTermCfg(
            mode="startup",
            func=dr.pd_gains,
            params={"kp_range": options.gain_range, "kd_range": options.gain_range},
        ),
        "trunk": EventTermCfg(
            mode="startup",
            func=dr.pseudo_inertia,
            params={"asset_cfg": SceneEntityCfg("robot", body_names=trunk), "alpha_range": options.trunk_density},
        ),
        "begin": EventTermCfg(mode="reset", func=begin_episodes),
    }
    if options.push_speed[1] > 0.0:
        events["push_velocity"] = EventTermCfg(
            mode="interval", interval_range_s=options.push_interval_s, func=push_velocity
        )
    if options.push_impulse[1] > 0.0:
        events["push_force"] = EventTermCfg(mode="step", func=PushForce)
    return events
