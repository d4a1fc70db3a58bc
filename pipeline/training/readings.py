"""What the environment's terms read of the simulation, each worked out once for a state.

Root velocities and joints come straight from qpos and qvel. Orientations and places of links lag them by one physics
step while rewards and terminations are worked out, and are fresh for observations and motion features (see mjlab's
`step`). Each call is a launch on the GPU; this file is written for few.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import torch
from mjlab.utils.lab_api.math import matrix_from_quat

from pipeline.learning.training_error import TrainingError
from pipeline.training.masks import replace
from pipeline.training.plain_walk import AIR_S
from pipeline.training.reward_terms import told_to_move, tracking

AT_M = 1e-6
"""What is that close is the same place [m]."""

MEAN_TIME_S = 0.4
"""Time constant of the averaged velocity."""

CONTACT_FORCE = 1.0
"""Force [N] above which a foot is on the ground."""


def velocity_of(
    rotation: torch.Tensor, lin_vel_w: torch.Tensor, ang_vel_b: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Forward and lateral velocity in the frame that shares only the root's heading, and the rate about the vertical.

    `rotation` (n, 3, 3) turns the root's frame into the world's. The second result (n, 2) is the heading as (cos, sin).
    """
    heading = torch.nn.functional.normalize(rotation[:, :2, 0], dim=1)
    x, y = lin_vel_w[:, 0], lin_vel_w[:, 1]
    cos, sin = heading[:, 0], heading[:, 1]
    yaw_rate = (rotation[:, 2] * ang_vel_b).sum(dim=1)
    return torch.stack([x * cos + y * sin, y * cos - x * sin, yaw_rate], dim=1), heading


def _kept(work: Any) -> Any:
    """A property that is worked out once for each state of the simulation; `Readings.fresh` says when it is another."""

    def value(self: Readings) -> Any:
        if work.__name__ not in self._known:
            self._known[work.__name__] = work(self)
        return self._known[work.__name__]

    value.__doc__ = work.__doc__
    return property(value)


def _sole_corners(model: mujoco.MjModel, shapes: list[str], feet: tuple[str, str]) -> torch.Tensor:
    """Corners (2, 4, 3) of the soles of the left and right foot from their centres, in the feet's frames [m].

    Raises TrainingError for a foot that is no box above the middle of its sole.
    """
    found = []
    for foot in feet:
        body = model.site(f"robot/{foot}").bodyid[0]
        boxes = [geom for geom in (model.geom(f"robot/{name}") for name in shapes) if geom.bodyid[0] == body]
        if len(boxes) != 1 or boxes[0].type[0] != mujoco.mjtGeom.mjGEOM_BOX:
            raise TrainingError(f"the foot of '{foot}' has {len(boxes)} shapes; corners are known of one box.")
        off = model.site(f"robot/{foot}").pos - boxes[0].pos + [0.0, 0.0, boxes[0].size[2]]
        if np.abs(off).max() > AT_M or np.abs(boxes[0].quat - [1.0, 0.0, 0.0, 0.0]).max() > AT_M:
            raise TrainingError(
                f"the box of '{foot}' is not square above its sole's middle (by {np.abs(off).max():g} m)."
            )
        length, width, _ = boxes[0].size
        found.append([[x * length, y * width, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    return torch.tensor(found, dtype=torch.float32)


class Readings:
    """Quantities of N environments at the current step. Joints are in the robot's order (J).

    `fresh` is called where the state has changed: after the physics steps, after resets, before observations; and at
    the end of a step, as one that is replayed does not call it.
    """

    def __init__(self, env, feet: tuple[str, str], ends: tuple[str, ...]):
        self._env = env
        self._robot = env.scene["robot"]
        self._indexing = self._robot.indexing
        self._root = self._indexing.root_body_id
        self._foot_sites, self._end_sites = self._sites(feet), self._sites(ends)
        self._foot_bodies = env.sim.model.site_bodyid[self._foot_sites]
        if env.context.options.slide_of == "lowest":
            shapes = env.context.bundle.robot.shapes["feet"]
            self._corners = _sole_corners(env.sim.mj_model, shapes, feet).to(env.device)
        self._forces = {name: self._addresses(name) for name in ("feet_contact", "other_contact")}
        self._mean = torch.zeros(env.num_envs, 3, device=env.device)
        self._stance = torch.zeros(env.num_envs, 2, device=env.device)
        self._stood = torch.zeros(env.num_envs, 2, dtype=torch.bool, device=env.device)
        self._landed = torch.zeros(env.num_envs, 2, dtype=torch.bool, device=env.device)
        self._set_down = torch.full((env.num_envs,), -1, device=env.device)
        self._since = torch.zeros(env.num_envs, device=env.device)
        self._step = torch.zeros(env.num_envs, device=env.device)
        self._both = torch.zeros(env.num_envs, device=env.device)
        self._double = torch.zeros(env.num_envs, device=env.device)
        self._known: dict[str, torch.Tensor] = {}

    def fresh(self) -> None:
        """The simulation's state is another one now."""
        self._known.clear()

    def _sites(self, names: tuple[str, ...]) -> torch.Tensor:
        local, _ = self._robot.find_sites(names, preserve_order=True)
        return self._indexing.site_ids[torch.as_tensor(local, device=self._env.device)]

    def _addresses(self, sensor: str) -> torch.Tensor:
        """Where the force vectors of a contact sensor are in the sensors' data (b, 3)."""
        model = self._env.sim.mj_model
        names = [f"{sensor}_{primary}_force" for primary in self._env.scene[sensor].primary_names]
        first = torch.tensor([int(model.sensor(name).adr[0]) for name in names], device=self._env.device)
        return first[:, None] + torch.arange(3, device=self._env.device)

    @_kept
    def _qpos(self) -> torch.Tensor:
        return self._env.sim.data.qpos[:, :]

    @_kept
    def _qvel(self) -> torch.Tensor:
        return self._env.sim.data.qvel[:, :]

    @property
    def root_pos_w(self) -> torch.Tensor:
        return self._qpos[:, :3]

    @property
    def root_link_pos_w(self) -> torch.Tensor:
        """The same at the instant of the other links' places: a physics step ago while rewards are worked out."""
        return self._env.sim.data.xpos[:, self._root]

    @property
    def height(self) -> torch.Tensor:
        """Of the root above the ground where the episode began [m]."""
        return self._qpos[:, 2] - self._env.scene.env_origins[:, 2]

    @property
    def root_quat_w(self) -> torch.Tensor:
        return self._qpos[:, 3:7]

    @_kept
    def root_rotation_w(self) -> torch.Tensor:
        """Turns the root's frame into the world's (n, 3, 3)."""
        return self._env.sim.data.xmat[:, self._root]

    @property
    def lin_vel_w(self) -> torch.Tensor:
        return self._qvel[:, :3]

    @_kept
    def lin_vel_b(self) -> torch.Tensor:
        return torch.bmm(self.lin_vel_w[:, None], self.root_rotation_w)[:, 0]

    @property
    def ang_vel_b(self) -> torch.Tensor:
        return self._qvel[:, 3:6]

    @_kept
    def gravity_b(self) -> torch.Tensor:
        """Direction of gravity in the root's frame, unit."""
        slopes = self._env.slopes
        if slopes is None:
            return -self.root_rotation_w[:, 2]
        return torch.bmm(slopes.down_w[:, None], self.root_rotation_w)[:, 0]

    @_kept
    def _planar(self) -> tuple[torch.Tensor, torch.Tensor]:
        return velocity_of(self.root_rotation_w, self.lin_vel_w, self.ang_vel_b)

    @property
    def velocity(self) -> torch.Tensor:
        """Forward and lateral velocity in the yaw frame [m/s] and yaw rate about the vertical [rad/s] (n, 3)."""
        return self._planar[0]

    @property
    def heading_w(self) -> torch.Tensor:
        """Where the root faces, (cos, sin) (n, 2)."""
        return self._planar[1]

    @property
    def mean_velocity(self) -> torch.Tensor:
        """`velocity` averaged over MEAN_TIME_S (n, 3)."""
        return self._mean

    @_kept
    def tracking(self) -> torch.Tensor:
        """How well the command is followed on each axis (n, 3)."""
        return tracking(self._env.command, self._env.tracked_velocity, self._env.context.options.sigma2)

    @property
    def joint_pos(self) -> torch.Tensor:
        return self._qpos[:, 7:]

    @property
    def joint_vel(self) -> torch.Tensor:
        return self._qvel[:, 6:]

    @property
    def joint_acc(self) -> torch.Tensor:
        return self._env.sim.data.qacc[:, 6:]

    @_kept
    def torque(self) -> torch.Tensor:
        """What the motors give [N m] (n, j)."""
        return self._env.sim.data.qfrc_actuator[:, 6:]

    @_kept
    def feet_pos_w(self) -> torch.Tensor:
        """Centres of the left and right sole (n, 2, 3)."""
        return self._env.sim.data.site_xpos[:, self._foot_sites]

    @property
    def ends_pos_w(self) -> torch.Tensor:
        """Hands and feet in the order of the expert frames (n, 4, 3)."""
        return self._env.sim.data.site_xpos[:, self._end_sites]

    @property
    def feet_vel_w(self) -> torch.Tensor:
        """Velocity of the centres of the soles (n, 2, 3) [m/s]."""
        data = self._env.sim.data
        cvel = data.cvel[:, self._foot_bodies]
        arm = self.feet_pos_w - data.subtree_com[:, self._root, None]
        return cvel[..., 3:] + torch.cross(cvel[..., :3], arm, dim=-1)

    @property
    def lowest_corner_vel_w(self) -> torch.Tensor:
        """Velocity of each sole's lowest corner (n, 2, 3) [m/s]: 0 for a foot that rolls over heel and toe.

        There only where `slide_of` is `lowest`.
        """
        data = self._env.sim.data
        rotation = data.xmat[:, self._foot_bodies]
        lowest = (rotation[:, :, 2, None] * self._corners).sum(dim=-1).argmin(dim=-1)
        corner = self._corners[torch.arange(2, device=lowest.device), lowest]
        arm = (rotation @ corner[..., None])[..., 0]
        return self.feet_vel_w + torch.cross(data.cvel[:, self._foot_bodies, :3], arm, dim=-1)

    @_kept
    def feet_force_w(self) -> torch.Tensor:
        """Net contact force on each foot [N] at the last physics step (n, 2, 3)."""
        return self._env.sim.data.sensordata[:, self._forces["feet_contact"]]

    @_kept
    def contacts(self) -> torch.Tensor:
        """Feet that touch the ground (n, 2)."""
        return torch.linalg.norm(self.feet_force_w, dim=-1) > CONTACT_FORCE

    @property
    def other_force_w(self) -> torch.Tensor:
        """Net contact force on each shape that must not touch (n, b, 3)."""
        return self._env.sim.data.sensordata[:, self._forces["other_contact"]]

    @property
    def stance_time(self) -> torch.Tensor:
        """How long each foot has been on the ground, or in the air [s] (n, 2)."""
        return self._stance

    @property
    def landed(self) -> torch.Tensor:
        """Feet (n, 2) that have just been set down after a swing."""
        return self._landed

    @property
    def step_s(self) -> torch.Tensor:
        """Where a foot has just been set down, how long ago the other one was, the last time [s] (n,); else 0.

        A foot that bounces, or is set down twice running, makes no step; nor do both at once, nor the first one of an
        episode or after standing.
        """
        return self._step

    @property
    def double_s(self) -> torch.Tensor:
        """Where a step ends (`step_s`), how long both feet were on the ground in it [s] (n,); else 0."""
        return self._double

    def advance(self) -> None:
        """Once a control step, before rewards: the averaged velocity and the times of stances and steps move on."""
        self.fresh()
        self._mean += (torch.nan_to_num(self.velocity) - self._mean) * (self._env.step_dt / MEAN_TIME_S)
        self._advance_stances(self.contacts, told_to_move(self._env.command))

    def _advance_stances(self, contacts: torch.Tensor, moves: torch.Tensor) -> None:
        """The times of stances and steps, with feet (n, 2) that touch the ground now and who is told to move (n,)."""
        same, lasted = contacts == self._stood, self._stance + self._env.step_dt
        self._landed.copy_(contacts & ~same & (lasted >= AIR_S - 1e-6))
        self._advance_steps(self._landed, moves)
        self._stance.copy_(lasted * same)
        self._stood.copy_(contacts)

    def _advance_steps(self, landed: torch.Tensor, moves: torch.Tensor) -> None:
        """The time of steps, with feet (n, 2) that are set down now after a swing."""
        self._since += self._env.step_dt
        self._both += self._env.step_dt * self._stood.all(dim=1)
        one, both = landed.any(dim=1), landed.all(dim=1)
        foot = torch.where(landed[:, 0], 0, 1)
        stepped = one & ~both & (foot != self._set_down) & (self._set_down >= 0)
        self._step.copy_(self._since * stepped)
        self._double.copy_(self._both * stepped)
        self._since *= ~one
        self._both *= ~one
        down = torch.where(both, -1, torch.where(one, foot, self._set_down))
        self._set_down.copy_(torch.where(moves, down, -1))

    def restart(self, mask: torch.Tensor) -> None:
        """The averaged velocity of environments that begin an episode is the one they begin with."""
        self.fresh()
        rotation = matrix_from_quat(self.root_quat_w)
        replace(self._mean, mask, velocity_of(rotation, self.lin_vel_w, self.ang_vel_b)[0])
        replace(self._stance, mask, 0.0)
        replace(self._set_down, mask, -1)
