"""How the trunk leans in the expert's clips, by the command that they obey.

The discriminator sees a frame from the trunk, so to it, and to a robot that tracks a clip's joints, a body that leans
back as a whole is like one that does not: policies leant 9 to 11 degrees back at .6 m/s, where the clips lean 3 ahead.
"""

from __future__ import annotations

import numpy as np
import torch

from pipeline.training.bundle import ExpertFrames
from pipeline.training.command_cells import frame_cells
from pipeline.training.motion_features import up_b


class TrunkLean:
    """The clips' mean direction of gravity in the trunk's frame for any command: that of the nearest cell of frames."""

    def __init__(self, expert: ExpertFrames, device: str):
        gravity = -up_b(torch.from_numpy(expert.frames[:, 3:7]))[:, :2].numpy()
        self._cells = frame_cells(expert.command, device)
        mean = [gravity[member].mean(axis=0) for member in self._cells.members]
        self._gravity = torch.from_numpy(np.array(mean)).float().to(device)

    def __call__(self, command: torch.Tensor) -> torch.Tensor:
        """Its first two components (n, 2) for commands (n, 3); (0, 0) is upright, the first positive ahead."""
        return self._gravity[self._cells.nearest(command)]
