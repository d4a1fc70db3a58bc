"""The tracker as the teacher: reference clips of all environments, and the tracker's actions.

The student observes as command the velocity of the tracker's own rollout at the clip's frame (`References.command`).
The clip is kept close to the robot: every few steps the nearest of three frames is selected, and the clip is moved
along when the robot's offset exceeds a bound, so that the tracker neither catches up nor waits.
"""

import itertools

import mujoco
import numpy as np
import torch
from mjlab.utils.lab_api.math import matrix_from_quat

from pipeline.learning.policy_file import Network
from pipeline.learning.robot_facts import RobotFacts
from pipeline.tracking.reference import reference_states
from pipeline.tracking.task import ACTION_SCALE
from pipeline.training.amp.expert import WINDOWS, sample_by_command
from pipeline.training.bundle import References, Teacher
from pipeline.training.config import Config
from pipeline.training.masks import replace
from pipeline.training.mdp.actions import SCALE
from pipeline.training.mdp.start_states import StartStates

SEARCH_EVERY = 4
"""Control steps between searches for the nearest frame."""
MAX_OFFSET_M = 0.1
"""Largest position offset from the clip that the tracker observes [m]."""
MAX_YAW_OFFSET = 0.2
"""Largest heading offset from the clip that the tracker observes [rad]."""
MAX_HEIGHT_ERROR_M, MAX_GRAVITY_ERROR = 0.25, 0.8
"""Errors of root height [m] and of the projected gravity that terminate an episode, as in mjlab's tracking task."""
LAST_FRAMES = 25
"""Number of last frames of a clip in which no episode begins."""


class ClipTeacher:
    """Reference clips of N environments, and the tracker's actions."""

    def __init__(self, teacher: Teacher, robot: RobotFacts, config: Config, device: str):
        """
        Args:
            teacher: tracker and references of a bundle
            robot: the bundle's robot
            config: configuration of the run
            device: device of the tensors

        Raises TrainingError if no clip is tracked at its speed.
        """
        self.references = teacher.references.tracked_at_speed(config.distillation.speed_tolerance)
        self._network, self._robot, self._config = Network(teacher.network, device), robot, config
        self._device, count = device, config.simulation.num_envs
        self._read_clips(self.references, robot)
        self._controlled = torch.from_numpy(robot.index(robot.controlled)).to(device)
        self._policy = torch.from_numpy(robot.index(robot.policy_joints)).to(device)
        self._default = torch.from_numpy(robot.default_joint_pos).float().to(device)
        self.frame = torch.zeros(count, dtype=torch.long, device=device)
        """Current reference frame of each environment, an index over all clips (n,)."""
        self.path_xy = torch.zeros(count, 2, device=device)
        """World position of the clip at its current frame (n, 2) [m]."""
        self.yaw_offset = torch.zeros(count, device=device)
        """Rotation of the clip about the vertical (n,) [rad]."""
        self.command = torch.zeros(count, 3, device=device)
        self.tracking_failed = torch.zeros(count, dtype=torch.bool, device=device)
        self.clip_ended = torch.zeros(count, dtype=torch.bool, device=device)
        self._last_action = torch.zeros(count, len(robot.controlled), device=device)
        self._links: torch.Tensor | None = None

    def _read_clips(self, clips: References, robot: RobotFacts) -> None:
        model = mujoco.MjModel.from_xml_string(robot.mjcf)
        states = [
            reference_states(model, *(part.astype(float) for part in parts))
            for parts in (
                (clips.root_pos_w[a:b], clips.root_quat_w[a:b], clips.joint_pos[a:b])
                for a, b in itertools.pairwise(clips.clip_start)
            )
        ]

        def joined(name: str, root: bool) -> torch.Tensor:
            parts = [getattr(state, name)[:, 0] if root else getattr(state, name) for state in states]
            return torch.from_numpy(np.concatenate(parts)).float().to(self._device)

        self._joint_pos, self._joint_vel = joined("joint_pos", False), joined("joint_vel", False)
        self._root_pos, self._root_quat = joined("body_pos_w", True), joined("body_quat_w", True)
        self._lin_vel, self._ang_vel = joined("body_lin_vel_w", True), joined("body_ang_vel_w", True)
        self._rotation = matrix_from_quat(self._root_quat)
        self._yaw = torch.atan2(self._rotation[:, 1, 0], self._rotation[:, 0, 0])
        self._label = torch.from_numpy(clips.command).float().to(self._device)
        length = np.diff(clips.clip_start)
        bounds = (np.repeat(clips.clip_start[:-1], length), np.repeat(clips.clip_start[1:] - 1, length))
        self._first, self._last = (torch.from_numpy(each).long().to(self._device) for each in bounds)

    def starts(self, seed: int) -> StartStates:
        """Start states of episodes, sampled such that commands are distributed as the policy's."""
        start = self.references.clip_start
        allowed = np.concatenate([np.arange(b - a) < max(b - a - LAST_FRAMES, 1) for a, b in itertools.pairwise(start)])
        drawn, *_ = sample_by_command(self.references.command, allowed, self._config.commands, seed, WINDOWS, 0.0)
        start_index = torch.from_numpy(drawn).to(self._device)
        return StartStates(
            root_pos=self._root_pos,
            root_quat=self._root_quat,
            joint_pos=self._joint_pos,
            lin_vel_w=self._lin_vel,
            ang_vel_w=self._ang_vel,
            joint_vel=self._joint_vel,
            command=self._label,
            drawn=start_index,
            kept_command=self._label[start_index],
        )

    def begin(self, env, mask: torch.Tensor, frame: torch.Tensor, yaw: torch.Tensor) -> None:
        """Start the clips of the environments in `mask` (n,) at `frame` (n,), rotated by `yaw` (n,) [rad]."""
        replace(self.frame, mask, frame)
        replace(self.yaw_offset, mask, yaw)
        replace(self.path_xy, mask, env.scene.env_origins[:, :2])
        replace(self.command, mask, self._label[frame])
        replace(self._last_action, mask, 0.0)

    def advance(self, env) -> None:
        """Advance the clips by a control step and align them with the robots; update failures and clip ends."""
        state = env.robot_state
        before = self.frame.clone()
        expected = torch.minimum(before + 1, self._last[before])
        searches = (env.episode_length_buf + 1) % SEARCH_EVERY == 0
        frame = torch.where(searches, self._nearest(expected, state.joint_pos), expected)
        self.frame.copy_(frame)
        cos, sin = torch.cos(self.yaw_offset), torch.sin(self.yaw_offset)
        x, y = (self._root_pos[frame, :2] - self._root_pos[before, :2]).unbind(dim=1)
        path = self.path_xy + torch.stack([x * cos - y * sin, x * sin + y * cos], dim=1)
        offset = state.root_pos_w[:, :2] - path
        distance = torch.linalg.norm(offset, dim=1, keepdim=True)
        self.path_xy.copy_(path + offset * (1.0 - MAX_OFFSET_M / distance.clamp(min=MAX_OFFSET_M)))
        heading = torch.atan2(state.heading_w[:, 1], state.heading_w[:, 0])
        error = heading - self._yaw[frame] - self.yaw_offset
        error = torch.atan2(torch.sin(error), torch.cos(error))
        self.yaw_offset += error - error.clamp(-MAX_YAW_OFFSET, MAX_YAW_OFFSET)
        height = state.root_pos_w[:, 2] - env.scene.env_origins[:, 2] - self._root_pos[frame, 2]
        vertical = state.root_rotation_w[:, 2, 2] - self._rotation[frame, 2, 2]
        self.tracking_failed.copy_((height.abs() > MAX_HEIGHT_ERROR_M) | (vertical.abs() > MAX_GRAVITY_ERROR))
        self.clip_ended.copy_(frame >= self._last[frame] - 1)
        self.command.copy_(self._label[frame])

    def _nearest(self, expected: torch.Tensor, joint_pos: torch.Tensor) -> torch.Tensor:
        """Of the expected frame (n,) and its two neighbours, the frame with the nearest joint positions (n,)."""
        first, last = self._first[expected], self._last[expected]
        candidates = torch.stack([expected, expected - 1, expected + 1], dim=1)
        candidates = torch.minimum(torch.maximum(candidates, first[:, None]), last[:, None])
        error = self._joint_pos[candidates][..., self._controlled] - joint_pos[:, None, self._controlled]
        best = torch.square(error).sum(dim=2).argmin(dim=1, keepdim=True)
        return candidates.gather(1, best)[:, 0]

    def observe(self, env) -> torch.Tensor:
        """The tracker's observation (n, o) of the current states, with the terms of `pipeline.tracking.reference`."""
        state, target = env.robot_state, self._target()
        links = self._link_index(env)
        to_root = state.root_rotation_w.transpose(1, 2)
        cos, sin = torch.cos(self.yaw_offset), torch.sin(self.yaw_offset)
        zero, one = torch.zeros_like(cos), torch.ones_like(cos)
        yaw_rotation = torch.stack([cos, -sin, zero, sin, cos, zero, zero, zero, one], dim=1).view(-1, 3, 3)
        displacement = yaw_rotation @ (self._root_pos[target] - self._root_pos[self.frame])[..., None]
        anchor_xy = self.path_xy + displacement[:, :2, 0]
        height = env.scene.env_origins[:, 2:] + self._root_pos[target, 2:]
        anchor_error = (torch.cat([anchor_xy, height], dim=1) - state.root_pos_w)[..., None]
        link_pos = env.sim.data.xpos[:, links] - state.root_pos_w[:, None]
        link_rotation = to_root[:, None] @ env.sim.data.xmat[:, links]
        terms = [
            self._joint_pos[target],
            self._joint_vel[target],
            (to_root @ anchor_error)[..., 0],
            (to_root @ yaw_rotation @ self._rotation[target])[..., :2].flatten(1),
            (link_pos @ state.root_rotation_w).flatten(1),
            link_rotation[..., :2].flatten(1),
            state.lin_vel_b,
            state.ang_vel_b,
            state.joint_pos - self._default,
            state.joint_vel,
            self._last_action,
        ]
        return torch.cat(terms, dim=1)

    def _link_index(self, env) -> torch.Tensor:
        """Body indices of the key links in the simulation (k,)."""
        links = self._links
        if links is None:
            robot = env.scene["robot"]
            local, _ = robot.find_bodies(self._robot.key_links, preserve_order=True)
            links = self._links = robot.indexing.body_ids[torch.as_tensor(local, device=self._device)]
        return links

    def act(self, env) -> torch.Tensor:
        """The policy action (n, a) that yields the tracker's joint targets for the current states."""
        residual = self._network(torch.nan_to_num(self.observe(env)))
        targets = self._default.repeat(len(residual), 1)
        targets[:, self._controlled] = self._joint_pos[self._target()][:, self._controlled] + ACTION_SCALE * residual
        return (targets - self._default)[:, self._policy] / SCALE

    def record_action(self, action: torch.Tensor) -> None:
        """Store the executed policy action (n, a) as the tracker's last action."""
        targets = self._default.repeat(len(action), 1)
        targets[:, self._policy] += SCALE * action
        residual = (targets - self._joint_pos[self._target()])[:, self._controlled] / ACTION_SCALE
        self._last_action.copy_(residual)

    def _target(self) -> torch.Tensor:
        """Target frame at the end of the control step (n,)."""
        return torch.minimum(self.frame + 1, self._last[self.frame])
