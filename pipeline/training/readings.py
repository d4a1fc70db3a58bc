"""What the environment's terms read of the simulation, worked out once a step.

Root state and joints come straight from qpos and qvel. Places of links lag them by one physics step while rewards and
terminations are worked out, and are fresh for observations and motion features (see mjlab's `step`).
"""

from __future__ import annotations

import torch
from mjlab.utils.lab_api.math import quat_apply, quat_apply_inverse

MEAN_TIME_S = 0.4
"""Time constant of the averaged velocity."""

CONTACT_FORCE = 1.0
"""Force [N] above which a foot is on the ground."""


def yaw_frame(quat: torch.Tensor, vector_w: torch.Tensor) -> torch.Tensor:
    """World vectors (n, 3) in the frame that shares only the heading of `quat` (n, 4, wxyz)."""
    forward = quat_apply(quat, torch.tensor([1.0, 0.0, 0.0], device=quat.device).expand(len(quat), 3))
    length = torch.linalg.norm(forward[:, :2], dim=1).clamp(min=1e-6)
    cos, sin = forward[:, 0] / length, forward[:, 1] / length
    x = vector_w[:, 0] * cos + vector_w[:, 1] * sin
    y = -vector_w[:, 0] * sin + vector_w[:, 1] * cos
    return torch.stack([x, y, vector_w[:, 2]], dim=1)


def _kept(work):
    """A property that is worked out once for each state of the simulation; `Readings.fresh` says when it is another."""

    def value(self: Readings) -> torch.Tensor:
        if work.__name__ not in self._known:
            self._known[work.__name__] = work(self)
        return self._known[work.__name__]

    value.__doc__ = work.__doc__
    return property(value)


class Readings:
    """Quantities of N environments at the current step. Joints are in the robot's order (J).

    `fresh` is called where the state has changed: after the physics steps, after resets, before observations.
    """

    def __init__(self, env, feet: tuple[str, str], ends: tuple[str, ...]):
        self._env = env
        self._robot = env.scene["robot"]
        self._foot_sites = self._sites(feet)
        self._end_sites = self._sites(ends)
        self._mean = torch.zeros(env.num_envs, 3, device=env.device)
        self._known: dict[str, torch.Tensor] = {}

    def fresh(self) -> None:
        """The simulation's state is another one now."""
        self._known.clear()

    def _sites(self, names: tuple[str, ...]) -> torch.Tensor:
        local, _ = self._robot.find_sites(names, preserve_order=True)
        return self._robot.indexing.site_ids[torch.as_tensor(local, device=self._env.device)]

    @property
    def _qpos(self) -> torch.Tensor:
        return self._env.sim.data.qpos[:, self._robot.indexing.free_joint_q_adr]

    @property
    def _qvel(self) -> torch.Tensor:
        return self._env.sim.data.qvel[:, self._robot.indexing.free_joint_v_adr]

    @property
    def root_pos_w(self) -> torch.Tensor:
        return self._qpos[:, :3]

    @property
    def height(self) -> torch.Tensor:
        """Of the root above the ground where the episode began [m]."""
        return self._qpos[:, 2] - self._env.scene.env_origins[:, 2]

    @property
    def root_quat_w(self) -> torch.Tensor:
        return self._qpos[:, 3:7]

    @property
    def lin_vel_w(self) -> torch.Tensor:
        return self._qvel[:, :3]

    @_kept
    def lin_vel_b(self) -> torch.Tensor:
        return quat_apply_inverse(self.root_quat_w, self.lin_vel_w)

    @property
    def ang_vel_b(self) -> torch.Tensor:
        return self._qvel[:, 3:6]

    @_kept
    def gravity_b(self) -> torch.Tensor:
        """Direction of gravity in the root's frame, unit."""
        down = torch.tensor([0.0, 0.0, -1.0], device=self._env.device)
        return quat_apply_inverse(self.root_quat_w, down.expand(self._env.num_envs, 3))

    @_kept
    def velocity(self) -> torch.Tensor:
        """Forward and lateral velocity in the yaw frame [m/s] and yaw rate about the vertical [rad/s] (n, 3)."""
        planar = yaw_frame(self.root_quat_w, self.lin_vel_w)[:, :2]
        yaw_rate = quat_apply(self.root_quat_w, self.ang_vel_b)[:, 2:]
        return torch.cat([planar, yaw_rate], dim=1)

    @property
    def mean_velocity(self) -> torch.Tensor:
        """`velocity` averaged over MEAN_TIME_S (n, 3)."""
        return self._mean

    @property
    def joint_pos(self) -> torch.Tensor:
        return self._robot.data.joint_pos

    @property
    def joint_vel(self) -> torch.Tensor:
        return self._robot.data.joint_vel

    @property
    def joint_acc(self) -> torch.Tensor:
        return self._robot.data.joint_acc

    @property
    def torque(self) -> torch.Tensor:
        """What the motors give [N m] (n, j)."""
        return self._robot.data.qfrc_actuator

    @property
    def feet_pos_w(self) -> torch.Tensor:
        """Centres of the left and right sole (n, 2, 3)."""
        return self._env.sim.data.site_xpos[:, self._foot_sites]

    @property
    def ends_pos_w(self) -> torch.Tensor:
        """Hands and feet in the order of the expert frames (n, 4, 3)."""
        return self._env.sim.data.site_xpos[:, self._end_sites]

    @_kept
    def feet_vel_w(self) -> torch.Tensor:
        """Velocity of the centres of the soles (n, 2, 3) [m/s]."""
        data = self._env.sim.data
        body = self._env.sim.model.site_bodyid[self._foot_sites]
        cvel = data.cvel[:, body]
        arm = data.site_xpos[:, self._foot_sites] - data.subtree_com[:, self._robot.indexing.root_body_id, None]
        return cvel[..., 3:] + torch.cross(cvel[..., :3], arm, dim=-1)

    @property
    def feet_force_w(self) -> torch.Tensor:
        """Net contact force on each foot [N] at the last physics step (n, 2, 3)."""
        return self._env.scene["feet_contact"].data.force

    @property
    def feet_force_history_w(self) -> torch.Tensor:
        """The same at each physics step of the control step (n, 2, h, 3)."""
        return self._env.scene["feet_contact"].data.force_history

    @_kept
    def contacts(self) -> torch.Tensor:
        """Feet that touched the ground during the control step (n, 2)."""
        return torch.linalg.norm(self.feet_force_history_w, dim=-1).amax(dim=-1) > CONTACT_FORCE

    @property
    def other_force_history_w(self) -> torch.Tensor:
        """Net contact force on each link that must not touch (n, b, h, 3)."""
        return self._env.scene["other_contact"].data.force_history

    @property
    def stance_time(self) -> torch.Tensor:
        """How long each foot has been on the ground, or in the air [s] (n, 2)."""
        data = self._env.scene["feet_contact"].data
        return torch.maximum(data.current_contact_time, data.current_air_time)

    def advance(self) -> None:
        """Once a control step, before rewards: the averaged velocity moves on."""
        self.fresh()
        self._mean += (self.velocity - self._mean) * (self._env.step_dt / MEAN_TIME_S)

    def restart(self, env_ids: torch.Tensor) -> None:
        """The averaged velocity of environments that begin an episode is the one they begin with."""
        self.fresh()
        self._mean[env_ids] = self.velocity[env_ids]
