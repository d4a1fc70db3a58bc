"""Commands of the expert's frames in cells, each of which answers the commands that it is nearest to."""

from __future__ import annotations

import numpy as np
import torch

from pipeline.training.expert_sampling import CELL

LEAST_FRAMES = 50
"""A cell with fewer frames (a second) is left out, unless all have fewer."""


def frame_cells(command: np.ndarray, device: str) -> CommandCells:
    """Of the commands (t, 3) of all frames [m/s, m/s, rad/s]: the cells with LEAST_FRAMES, or all where none has."""
    cells = CommandCells(command, LEAST_FRAMES, device)
    return cells if cells.members else CommandCells(command, 1, device)


class CommandCells:
    """The cells (k,) that at least `least` of some commands (m, 3) [m/s, m/s, rad/s] are in."""

    def __init__(self, command: np.ndarray, least: int, device: str):
        cells, member, count = np.unique(
            np.round(command / CELL).astype(int), axis=0, return_inverse=True, return_counts=True
        )
        taken = np.flatnonzero(count >= least)
        self.members = [member.ravel() == cell for cell in taken]
        """Which of the commands (m,) are in each."""
        self._cells = torch.from_numpy(cells[taken]).float().to(device)
        self._size = torch.from_numpy(CELL).float().to(device)

    def nearest(self, command: torch.Tensor) -> torch.Tensor:
        """The cell (n,) that answers each command (n, 3); there must be one."""
        return torch.cdist(command / self._size, self._cells).argmin(dim=1)
