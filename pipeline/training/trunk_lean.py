"""How the trunk leans in the expert's clips, by the command that they obey.

The discriminator sees a frame from the trunk, so to it, and to a robot that tracks a clip's joints, a body that leans
back as a whole is like one that does not: policies leant 9 to 11 degrees back at .6 m/s, where the clips lean 3 ahead.
"""

from __future__ import annotations

import numpy as np
import torch

from pipeline.training.bundle import ExpertFrames
from pipeline.training.expert_sampling import CELL

LEAST_FRAMES = 50
"""A cell with fewer frames (a second) is left out."""


def up_b(quat: torch.Tensor) -> torch.Tensor:
    """The vertical (t, 3) in the frames of unit quaternions (t, 4), w first."""
    w, x, y, z = quat.unbind(dim=1)
    return torch.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], dim=1)


class TrunkLean:
    """The clips' mean direction of gravity in the trunk's frame for any command: that of the nearest cell of frames."""

    def __init__(self, expert: ExpertFrames, device: str):
        gravity = -up_b(torch.from_numpy(expert.frames[:, 3:7]))[:, :2].numpy()
        cells, member, count = np.unique(
            np.round(expert.command / CELL).astype(int), axis=0, return_inverse=True, return_counts=True
        )
        taken = np.flatnonzero(count >= LEAST_FRAMES)
        if not len(taken):
            taken = np.arange(len(cells))
        mean = [gravity[member.ravel() == cell].mean(axis=0) for cell in taken]
        self._cells = torch.from_numpy(cells[taken]).float().to(device)
        self._size = torch.from_numpy(CELL).float().to(device)
        self._gravity = torch.from_numpy(np.array(mean)).float().to(device)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Its first two components (n, 2) for commands (n, 3); (0, 0) is upright, the first positive ahead."""
        away = torch.cdist(command / self._size, self._cells)
        return self._gravity[away.argmin(dim=1)]
