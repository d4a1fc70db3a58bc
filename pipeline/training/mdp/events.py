"""Domain randomization and disturbances: friction, gains, trunk mass, rotors, slopes, kicks and pushes.

mjlab's pushes sample by indices and keep their magnitude over a run. These pushes use masks and scale with
`env.disturbance`, the disturbance ramp, 0 to 1.
"""

import math

import mujoco
import numpy as np
import torch
import warp as wp
from mjlab.envs.mdp import dr
from mjlab.managers.event_manager import EventTermCfg, RecomputeLevel, requires_model_fields
from mjlab.managers.scene_entity_config import SceneEntityCfg

from pipeline.learning.robot_facts import RobotFacts
from pipeline.physics import GRAVITY
from pipeline.training.config import Config, PushesConfig
from pipeline.training.masks import replace
from pipeline.training.rotors import rotors_on_links

FORCE_S = 0.1
"""Duration of a force push [s]."""
SMALLEST_PUSH = 0.2
"""Smallest push as a fraction of the largest (paper)."""
SLOPED_SHARE = 1.0 / 3.0
"""Share of environments on a slope."""
ROTOR_LEVELS = 5
"""Number of discrete shares of rotor inertia on the links, from 0 to 1."""


class Slopes:
    """Sloped ground, simulated as tilted gravity on a plane, which is equivalent and costs nothing.

    Angle and direction of each environment are drawn once. The world's z axis is the ground's normal; gravity is tilted
    in both mjlab's data and the simulation.
    """

    def __init__(self, env):
        count, device = env.num_envs, env.device
        sloped = torch.rand(count, device=device) < SLOPED_SHARE
        steepest = math.radians(env.context.config.randomization.slope_deg)
        self._angle = steepest * torch.rand(count, device=device) * sloped
        azimuth = 2.0 * math.pi * torch.rand(count, device=device)
        self._direction_w = torch.stack([torch.cos(azimuth), torch.sin(azimuth)], dim=1)
        self.down_w = env.scene["robot"].data.gravity_vec_w
        """Unit gravity vector (n, 3), which mjlab's terms also read."""
        self._gravity_w = GRAVITY * self.down_w
        if steepest:
            env.sim.wp_model.opt.gravity = wp.from_torch(self._gravity_w, dtype=wp.vec3)
            env.sim.create_graph()  # an earlier graph reads one gravity vector shared by all environments

    def set_scale(self, share: float) -> None:
        """Set the slopes to a share (0 to 1) of their maximum."""
        tilt = share * self._angle[:, None]
        self.down_w.copy_(torch.cat([torch.sin(tilt) * self._direction_w, -torch.cos(tilt)], dim=1))
        self._gravity_w.copy_(GRAVITY * self.down_w)


class PushTimer:
    """Times and directions of one kind of push, in the unit of `max_push`; resets do not restart the timer.

    `max_push` is given for the T1 (before and after the ramp); `scale` converts it to the robot.
    """

    def __init__(self, env, config: PushesConfig, max_push: tuple[float, float], scale: float):
        self._env, self._span = env, config.interval_s
        self._max_push = (scale * max_push[0], scale * max_push[1])
        self._left_s = torch.zeros(env.num_envs, device=env.device)
        self._draw(torch.ones(env.num_envs, dtype=torch.bool, device=env.device))

    def due(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Advance by a control step; return whether a push begins (n,), and the push in the world frame (n, 3)."""
        self._left_s -= self._env.step_dt
        begins = self._left_s <= 0.0
        low, high = self._max_push
        push_w = horizontal(len(begins), SMALLEST_PUSH, begins.device) * (low + (high - low) * self._env.disturbance)
        replace(self._env.steps_since_push, begins, 0)
        self._draw(begins)
        return begins, push_w

    def _draw(self, mask: torch.Tensor) -> None:
        """Draw the time to the next push of environments in `mask` (n,)."""
        low, high = self._span
        replace(self._left_s, mask, low + (high - low) * torch.rand_like(self._left_s))


def horizontal(count: int, min_length: float, device: str | torch.device) -> torch.Tensor:
    """Vectors (count, 3) in random horizontal directions, of length `min_length` to 1."""
    angle = 2.0 * math.pi * torch.rand(count, device=device)
    length = min_length + (1.0 - min_length) * torch.rand(count, device=device)
    return torch.stack([length * torch.cos(angle), length * torch.sin(angle), torch.zeros_like(angle)], dim=1)


class Kick:
    """A sudden change of the base's velocity every few seconds."""

    def __init__(self, cfg: EventTermCfg, env):
        pushes = env.context.config.pushes
        scale = math.sqrt(env.context.bundle.robot.leg_ratio)
        self._timer = PushTimer(env, pushes, pushes.kick_m_s, scale)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        begins, change_w = self._timer.due()
        velocity_w = env.sim.data.qvel[:, :3]
        velocity_w += torch.where(begins[:, None], change_w, 0.0)


class Push:
    """A force on the trunk's centre of mass for FORCE_S every few seconds; `env.push_w` (n, 3) is the force [N]."""

    def __init__(self, cfg: EventTermCfg, env):
        pushes, robot = env.context.config.pushes, env.context.bundle.robot
        scale = robot.weight_ratio * math.sqrt(robot.leg_ratio)
        self._timer = PushTimer(env, pushes, pushes.impulse_n_s, scale)
        self._left_s = torch.zeros(env.num_envs, device=env.device)
        env.restarts.append(self.restart)

    def __call__(self, env, env_ids: torch.Tensor | None) -> None:
        self._left_s -= env.step_dt
        begins, impulse_w = self._timer.due()
        replace(env.push_w, self._left_s <= 1e-6, 0.0)
        replace(env.push_w, begins, impulse_w / FORCE_S)
        replace(self._left_s, begins, FORCE_S)

    def restart(self, mask: torch.Tensor) -> None:
        """End the pushes of environments in `mask` (n,); the environment zeroes the force."""
        replace(self._left_s, mask, 0.0)


@requires_model_fields("body_inertia", "body_iquat", "dof_armature", recompute=RecomputeLevel.set_const)
def rotors_on_some_links(env, env_ids: torch.Tensor | None) -> None:
    """Move a share of the rotor inertia to the links in some environments, at startup."""
    model, count = env.sim.mj_model, env.num_envs
    level = torch.randint(1, ROTOR_LEVELS, (count,), device=env.device)
    level *= torch.rand(count, device=env.device) < env.context.config.randomization.rotor_link_share
    variants = [rotors_on_links(model, each / (ROTOR_LEVELS - 1)) for each in range(ROTOR_LEVELS)]
    bodies = torch.from_numpy(np.unique(model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE]))
    rows, bodies = torch.arange(count, device=env.device)[:, None], bodies.long().to(env.device)[None]
    inertia, iquat, armature = (
        torch.from_numpy(np.stack(values)).float().to(env.device) for values in zip(*variants, strict=True)
    )
    for name, table in (("body_inertia", inertia), ("body_iquat", iquat)):
        getattr(env.sim.model, name)[rows, bodies] = table[level][rows, bodies]
    env.sim.model.dof_armature[:] = armature[level]


def event_cfg(robot: RobotFacts, config: Config, distils: bool) -> dict[str, EventTermCfg]:
    """Configuration of the events; distillation has no kicks or pushes."""
    random, pushes = config.randomization, config.pushes
    feet = SceneEntityCfg("robot", geom_names=tuple(f"^{name}$" for name in robot.shapes["feet"]))
    trunk = SceneEntityCfg("robot", body_names=(f"^{robot.root_link}$",))
    friction = {"asset_cfg": feet, "operation": "abs", "ranges": random.friction, "shared_random": True}
    gains = {"kp_range": random.gains, "kd_range": random.gains}
    mass = {"asset_cfg": trunk, "alpha_range": random.trunk_density}
    events = {
        "friction": EventTermCfg(mode="startup", func=dr.geom_friction, params=friction),
        "gains": EventTermCfg(mode="startup", func=dr.pd_gains, params=gains),
        "trunk": EventTermCfg(mode="startup", func=dr.pseudo_inertia, params=mass),
    }
    if random.rotor_link_share:
        events["rotors"] = EventTermCfg(mode="startup", func=rotors_on_some_links)
    if pushes.kick_m_s[1] and not distils:
        events["kick"] = EventTermCfg(mode="step", func=Kick)
    if pushes.impulse_n_s[1] and not distils:
        events["push"] = EventTermCfg(mode="step", func=Push)
    return events
