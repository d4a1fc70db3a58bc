"""State of N environments, read by terms; each quantity is computed once per simulation state.

Root velocities and joints come from qpos and qvel. While rewards and terminations are computed, link poses lag them by
one physics step; for observations and motion features they are current (see mjlab's `step`). Each torch call launches
a GPU kernel, so this file uses few of them.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import torch
from mjlab.utils.lab_api.math import matrix_from_quat

from pipeline.learning.training_error import TrainingError
from pipeline.training.masks import replace
from pipeline.training.plain_walk import MIN_SWING_S

SAME_PLACE_M = 1e-6
"""Tolerance within which positions are equal [m]."""

MEAN_TIME_S = 0.4
"""Time constant of the averaged velocity [s]."""

CONTACT_FORCE = 1.0
"""Contact force above which a foot is in contact [N]."""


def velocity_of(
    rotation: torch.Tensor, lin_vel_w: torch.Tensor, ang_vel_b: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Forward and lateral velocity in the yaw frame and yaw rate (n, 3), and the heading as (cos, sin) (n, 2).

    `rotation` (n, 3, 3) rotates the root frame to the world frame.
    """
    heading = torch.nn.functional.normalize(rotation[:, :2, 0], dim=1)
    x, y = lin_vel_w[:, 0], lin_vel_w[:, 1]
    cos, sin = heading[:, 0], heading[:, 1]
    yaw_rate = (rotation[:, 2] * ang_vel_b).sum(dim=1)
    return torch.stack([x * cos + y * sin, y * cos - x * sin, yaw_rate], dim=1), heading


def _cached(compute: Any) -> Any:
    """A property that is cached until `RobotState.invalidate`."""

    def value(self: RobotState) -> Any:
        if compute.__name__ not in self._cache:
            self._cache[compute.__name__] = compute(self)
        return self._cache[compute.__name__]

    value.__doc__ = compute.__doc__
    return property(value)


def _sole_corners(model: mujoco.MjModel, shapes: list[str], feet: tuple[str, str]) -> torch.Tensor:
    """Sole corners (2, 4, 3) of the left and right foot relative to the sole centres, in the foot frames [m].

    Raises TrainingError for a foot that is not one upright box centred above its site.
    """
    corners = []
    for foot in feet:
        body = model.site(f"robot/{foot}").bodyid[0]
        boxes = [geom for geom in (model.geom(f"robot/{name}") for name in shapes) if geom.bodyid[0] == body]
        if len(boxes) != 1 or boxes[0].type[0] != mujoco.mjtGeom.mjGEOM_BOX:
            do = "Give the foot one box in the robot's shapes.csv and write the bundle again."
            raise TrainingError(f"the foot of '{foot}' has {len(boxes)} shapes; it must have one box. {do}")
        offset = model.site(f"robot/{foot}").pos - boxes[0].pos + [0.0, 0.0, boxes[0].size[2]]
        if np.abs(offset).max() > SAME_PLACE_M or np.abs(boxes[0].quat - [1.0, 0.0, 0.0, 0.0]).max() > SAME_PLACE_M:
            raise TrainingError(
                f"the box of '{foot}' is not upright and centred above its site, the middle of the sole (off by "
                f"{np.abs(offset).max():g} m). Correct the robot's shapes.csv or sites.csv and write the bundle again."
            )
        length, width, _ = boxes[0].size
        corners.append([[x * length, y * width, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    return torch.tensor(corners, dtype=torch.float32)


class RobotState:
    """State of N environments at the current step. Joints are in the robot's order (J).

    `invalidate` is called whenever the state has changed: after physics steps, after resets, before observations; and
    at the end of a step, because a replayed CUDA graph does not call it.
    """

    def __init__(self, env, feet: tuple[str, str], ends: tuple[str, ...]):
        self._env = env
        self._robot = env.scene["robot"]
        self._indexing = self._robot.indexing
        self._root = self._indexing.root_body_id
        self._foot_sites, self._end_sites = self._sites(feet), self._sites(ends)
        self._foot_bodies = env.sim.model.site_bodyid[self._foot_sites]
        shapes = env.context.bundle.robot.shapes["feet"]
        self._corners = _sole_corners(env.sim.mj_model, shapes, feet).to(env.device)
        self._forces = {name: self._addresses(name) for name in ("feet_contact", "other_contact")}
        self._mean = torch.zeros(env.num_envs, 3, device=env.device)
        self._phase_s = torch.zeros(env.num_envs, 2, device=env.device)
        self._last_contacts = torch.zeros(env.num_envs, 2, dtype=torch.bool, device=env.device)
        self._landed = torch.zeros(env.num_envs, 2, dtype=torch.bool, device=env.device)
        self._cache: dict[str, torch.Tensor] = {}

    def invalidate(self) -> None:
        """Clear the cache of a state that has changed."""
        self._cache.clear()

    def _sites(self, names: tuple[str, ...]) -> torch.Tensor:
        local, _ = self._robot.find_sites(names, preserve_order=True)
        return self._indexing.site_ids[torch.as_tensor(local, device=self._env.device)]

    def _addresses(self, sensor: str) -> torch.Tensor:
        """Indices of a contact sensor's force vectors in `sensordata` (b, 3)."""
        model = self._env.sim.mj_model
        names = [f"{sensor}_{primary}_force" for primary in self._env.scene[sensor].primary_names]
        first = torch.tensor([int(model.sensor(name).adr[0]) for name in names], device=self._env.device)
        return first[:, None] + torch.arange(3, device=self._env.device)

    @_cached
    def _qpos(self) -> torch.Tensor:
        return self._env.sim.data.qpos[:, :]

    @_cached
    def _qvel(self) -> torch.Tensor:
        return self._env.sim.data.qvel[:, :]

    @property
    def root_pos_w(self) -> torch.Tensor:
        """Root position (n, 3) [m]."""
        return self._qpos[:, :3]

    @property
    def root_quat_w(self) -> torch.Tensor:
        """Root orientation (n, 4), wxyz."""
        return self._qpos[:, 3:7]

    @_cached
    def root_rotation_w(self) -> torch.Tensor:
        """Rotation from the root frame to the world frame (n, 3, 3)."""
        return self._env.sim.data.xmat[:, self._root]

    @property
    def lin_vel_w(self) -> torch.Tensor:
        """Root linear velocity (n, 3) [m/s]."""
        return self._qvel[:, :3]

    @_cached
    def lin_vel_b(self) -> torch.Tensor:
        """Root linear velocity in the root frame (n, 3) [m/s]."""
        return torch.bmm(self.lin_vel_w[:, None], self.root_rotation_w)[:, 0]

    @property
    def ang_vel_b(self) -> torch.Tensor:
        """Root angular velocity in the root frame (n, 3) [rad/s]."""
        return self._qvel[:, 3:6]

    @_cached
    def gravity_b(self) -> torch.Tensor:
        """Unit gravity vector in the root frame (n, 3)."""
        return torch.bmm(self._env.slopes.down_w[:, None], self.root_rotation_w)[:, 0]

    @_cached
    def _planar(self) -> tuple[torch.Tensor, torch.Tensor]:
        return velocity_of(self.root_rotation_w, self.lin_vel_w, self.ang_vel_b)

    @property
    def velocity(self) -> torch.Tensor:
        """Forward and lateral velocity in the yaw frame [m/s] and yaw rate about the vertical [rad/s] (n, 3)."""
        return self._planar[0]

    @property
    def heading_w(self) -> torch.Tensor:
        """Direction of the root's x axis in the plane as (cos, sin) (n, 2)."""
        return self._planar[1]

    @property
    def mean_velocity(self) -> torch.Tensor:
        """`velocity` averaged over MEAN_TIME_S (n, 3)."""
        return self._mean

    @property
    def joint_pos(self) -> torch.Tensor:
        """Joint positions (n, j) [rad]."""
        return self._qpos[:, 7:]

    @property
    def joint_vel(self) -> torch.Tensor:
        """Joint velocities (n, j) [rad/s]."""
        return self._qvel[:, 6:]

    @_cached
    def torque(self) -> torch.Tensor:
        """Motor torques at the last physics step (n, j) [N m]."""
        return self._env.sim.data.qfrc_actuator[:, 6:]

    @_cached
    def feet_pos_w(self) -> torch.Tensor:
        """Sole centres (n, 2, 3) [m]."""
        return self._env.sim.data.site_xpos[:, self._foot_sites]

    @property
    def ends_pos_w(self) -> torch.Tensor:
        """Hands and feet in the order of the expert frames (n, 4, 3) [m]."""
        return self._env.sim.data.site_xpos[:, self._end_sites]

    @property
    def lowest_corner_vel_w(self) -> torch.Tensor:
        """Velocity of each sole's lowest corner (n, 2, 3) [m/s]; 0 for a foot that rolls over heel and toe."""
        data = self._env.sim.data
        cvel, rotation = data.cvel[:, self._foot_bodies], data.xmat[:, self._foot_bodies]
        arm = self.feet_pos_w - data.subtree_com[:, self._root, None]
        centre = cvel[..., 3:] + torch.cross(cvel[..., :3], arm, dim=-1)
        lowest = (rotation[:, :, 2, None] * self._corners).sum(dim=-1).argmin(dim=-1)
        corner = self._corners[torch.arange(2, device=lowest.device), lowest]
        return centre + torch.cross(cvel[..., :3], (rotation @ corner[..., None])[..., 0], dim=-1)

    @_cached
    def feet_force_w(self) -> torch.Tensor:
        """Net contact force on each foot at the last physics step (n, 2, 3) [N]."""
        return self._env.sim.data.sensordata[:, self._forces["feet_contact"]]

    @_cached
    def contacts(self) -> torch.Tensor:
        """Contact of each foot (n, 2)."""
        return torch.linalg.norm(self.feet_force_w, dim=-1) > CONTACT_FORCE

    @property
    def other_force_w(self) -> torch.Tensor:
        """Net contact force on each other shape, which must not touch (n, b, 3) [N]."""
        return self._env.sim.data.sensordata[:, self._forces["other_contact"]]

    @property
    def landed(self) -> torch.Tensor:
        """Touchdown of each foot after a swing at this step (n, 2)."""
        return self._landed

    def advance(self) -> None:
        """Update the averaged velocity and the touchdowns, once per control step before terminations and rewards."""
        self.invalidate()
        self._mean += (torch.nan_to_num(self.velocity) - self._mean) * (self._env.step_dt / MEAN_TIME_S)
        same, phase_s = self.contacts == self._last_contacts, self._phase_s + self._env.step_dt
        self._landed.copy_(self.contacts & ~same & (phase_s >= MIN_SWING_S - 1e-6))
        self._phase_s.copy_(phase_s * same)
        self._last_contacts.copy_(self.contacts)

    def restart(self, mask: torch.Tensor) -> None:
        """Reset the averaged velocity to the start velocity, and the contact phases, of environments in `mask` (n,)."""
        self.invalidate()
        rotation = matrix_from_quat(self.root_quat_w)
        replace(self._mean, mask, velocity_of(rotation, self.lin_vel_w, self.ang_vel_b)[0])
        replace(self._phase_s, mask, -1.0)  # episodes begin above the ground; the first landing is not a touchdown
        replace(self._last_contacts, mask, False)
