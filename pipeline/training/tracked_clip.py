"""Episodes that track the clip they begin in: paid for staying near it, over where they stray from it, and with it.

The tracking of DeepMimic (Peng et al., ACM ToG 37(4), 2018), for a network that is not told the clip: its command is
the clip's at each frame, and what it saw last tells it where in a step it is. The clip's time goes with the robot's, at
.75 to 1.25 of its own rate: every few steps the nearest of its frames just before and after is taken.
"""

from __future__ import annotations

import itertools

import numpy as np
import torch

from pipeline.training.bundle import ExpertFrames
from pipeline.training.masks import replace
from pipeline.training.motion_features import up_b

JOINTS, ENDS, UP = 0.5, 0.05, 0.02
"""Sums of squared differences at which nearness has fallen to a half: of joints [rad^2], of hands and feet [m^2], of
the vertical as the trunk sees it (unit vectors: 8 degrees)."""
SPREADS = (1.33, 0.91)
"""These widths of a walk at .6 m/s in sums of the variances of its joints, hands and feet."""
EACH = (0.1, 0.4)
"""Widths of the two bells by which each joint's own nearness is told, from near and from afar [rad]."""
AGAIN = 4
"""Control steps after which the nearest frame is looked for."""
END_STRAY = (0.2, 0.07)
"""Who has a hand or a foot further than this from the clip's, seen from the trunk, has strayed [m, m per m/s of the
commanded speed]: a stride grows with its speed, and with .2 m for all the clips' own joints strayed from a run once a
second …"""
HEIGHT_STRAY_M = 0.12
"""… and whose trunk is this much higher or lower …"""
TILT_STRAY = 0.5
"""… or whose vertical, seen from the trunk, differs by so much from the clip's (of unit vectors)."""

Width = float | torch.Tensor


def nearness(
    away_joints: torch.Tensor,
    away_ends: torch.Tensor,
    away_up: torch.Tensor | None = None,
    widths: tuple[Width, Width] = (JOINTS, ENDS),
) -> torch.Tensor:
    """1 / (1 + |dq|^2 / JOINTS + |dp|^2 / ENDS + |du|^2 / UP) of differences in joints (…, a) [rad], in ends in the
    trunk's frame (…, 12) [m] and, where it counts, in the vertical there (…, 3). It has a slope far off too: from the
    default pose a run's frames are 10 away in that sum. `widths`: others than the first two (…)."""
    away = torch.square(away_joints).sum(dim=-1) / widths[0] + torch.square(away_ends).sum(dim=-1) / widths[1]
    return 1.0 / (1.0 + (away if away_up is None else away + torch.square(away_up).sum(dim=-1) / UP))


def each_near(away_joints: torch.Tensor) -> torch.Tensor:
    """Mean over joints of how near each is to where it should be, by differences (…, a) [rad]: the mean of two bells
    1 / (1 + dq^2 / w^2). A sum in one bell, as in `nearness`, is flat in all joints while one of them is far off: the
    turned forearms of a run, .6 rad from a policy's, hid its knees."""
    bells = [1.0 / (1.0 + torch.square(away_joints / width)) for width in EACH]
    return torch.stack(bells).mean(dim=0).mean(dim=-1)


def widths_of(expert: ExpertFrames) -> tuple[np.ndarray, np.ndarray]:
    """Of each frame (t,) what to take for JOINTS and ENDS so that who keeps to the mean of its clip's poses is paid
    hardly more than in a walk at .6 m/s, a third: by JOINTS and ENDS it is .7 in steps to the side and turns on the
    spot, where feet move by centimetres; by these .38 and .44. Never more than those, and at least a twentieth: so
    runs stay at .2, and standing is standing."""
    ends = 7 + expert.controlled
    parts = ((7, ends, JOINTS, SPREADS[0]), (ends, ends + 12, ENDS, SPREADS[1]))
    found = (np.empty(len(expert.frames), np.float32), np.empty(len(expert.frames), np.float32))
    for first, last in itertools.pairwise(expert.clip_start):
        for width, (begin, end, most, spreads) in zip(found, parts, strict=True):
            spread = float(expert.frames[first:last, begin:end].var(axis=0).sum())
            width[first:last] = np.clip(spreads * spread, 0.05 * most, most)
    return found


class TrackedClip:
    """Where in its clip each of N environments is, and which of them track one."""

    def __init__(self, env):
        self._env, expert = env, env.context.bundle.expert
        joints, device = expert.controlled, env.device
        frames = torch.from_numpy(expert.frames).to(device)
        self._joints, self._ends = frames[:, 7 : 7 + joints], frames[:, 7 + joints : 19 + joints]
        self._height, self._up_b = frames[:, 2], up_b(frames[:, 3:7])
        self._lean_counts = env.context.options.tracked_trunk
        alike = [np.full(len(frames), width, np.float32) for width in (JOINTS, ENDS)]
        widths = widths_of(expert) if env.context.options.tracked_by_clip else alike
        self._joints_width, self._ends_width = (torch.from_numpy(width).to(device) for width in widths)
        self._command = torch.from_numpy(expert.command).to(device)
        last = np.concatenate([np.full(b - a, b - 1) for a, b in itertools.pairwise(expert.clip_start)])
        self._last = torch.from_numpy(last).to(device)
        count = env.num_envs
        self._at = torch.zeros(count, dtype=torch.long, device=device)
        self._steps = torch.zeros(count, dtype=torch.long, device=device)
        self.tracks = torch.zeros(count, dtype=torch.bool, device=device)
        """Which environments track a clip."""
        self.near = torch.zeros(count, device=device)
        """How near each is to its clip, 0..1; 0 where it has none."""
        self.each_near = torch.zeros(count, device=device)
        """How near its joints are to the clip's, each by itself, 0..1; 0 where it has none."""
        self.strayed = torch.zeros(count, dtype=torch.bool, device=device)
        """Who was too far from its clip when it was last looked at."""
        self.over = torch.zeros(count, dtype=torch.bool, device=device)
        """Whose clip ended then."""

    @property
    def command(self) -> torch.Tensor:
        """The clips' commands (n, 3)."""
        return self._command[self._at]

    def seen(self) -> torch.Tensor:
        """What the critic is told (n, 2): how near the clip is, and whether there is one. Not its end, after which
        the episode could have gone on."""
        return torch.stack([self.near, self.tracks.float()], dim=1)

    def begin(self, mask: torch.Tensor, at: torch.Tensor, tracks: torch.Tensor) -> None:
        """Episodes of the mask begin at frames `at` of the expert, and some of them track its clip."""
        replace(self._at, mask, at)
        replace(self._steps, mask, 0)
        replace(self.tracks, mask, tracks)
        replace(self.near, mask, tracks.float())

    def advance(self) -> None:
        """A control step further, after the simulation's and before rewards and ends."""
        read, index = self._env.readings, self._env.controlled_index
        away = read.ends_pos_w - read.root_link_pos_w[:, None]
        ends_b = torch.bmm(away, read.root_rotation_w).flatten(1)
        self._go_on(read.joint_pos[:, index], ends_b, read.height, -read.gravity_b)

    def _go_on(self, joints: torch.Tensor, ends_b: torch.Tensor, height: torch.Tensor, up: torch.Tensor) -> None:
        last = self._last[self._at]
        self.over.copy_(self.tracks & (self._at + 1 >= last))
        self._steps += 1
        at = torch.minimum(self._at + 1, last)
        around = torch.stack([at - 1, at, torch.minimum(at + 1, last)], dim=1)
        each = self._nearness(around, joints[:, None], ends_b[:, None])
        nearest = around.gather(1, each.argmax(dim=1, keepdim=True))[:, 0]
        self._at.copy_(torch.where(self._steps % AGAIN == 0, nearest, at))
        off = ends_b - self._ends[self._at]
        lean = up - self._up_b[self._at]
        near = self._nearness(self._at, joints, ends_b, lean if self._lean_counts else None)
        self.near.copy_(torch.nan_to_num(near) * self.tracks)
        self.each_near.copy_(torch.nan_to_num(each_near(joints - self._joints[self._at])) * self.tracks)
        furthest = torch.linalg.norm(off.unflatten(1, (4, 3)), dim=2).amax(dim=1)
        still, by_speed = END_STRAY
        bound = still + by_speed * torch.linalg.norm(self._command[self._at, :2], dim=1)
        stays = (furthest < bound) & ((height - self._height[self._at]).abs() < HEIGHT_STRAY_M)
        stays &= torch.linalg.norm(lean, dim=1) < TILT_STRAY
        self.strayed.copy_(self.tracks & ~stays)

    def _nearness(
        self, at: torch.Tensor, joints: torch.Tensor, ends_b: torch.Tensor, lean: torch.Tensor | None = None
    ) -> torch.Tensor:
        widths = self._joints_width[at], self._ends_width[at]
        return nearness(joints - self._joints[at], ends_b - self._ends[at], lean, widths)
