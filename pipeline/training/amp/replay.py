"""Ring buffer of policy windows."""

import torch

SIZE = 500_000
"""Capacity in windows (paper); fewer with fewer than 4096 environments."""


class Replay:
    """Ring buffer of policy windows (m, h, f); its position and count stay on the device."""

    def __init__(self, size: int, shape: tuple[int, int], device: str):
        self._size = size
        self._windows = torch.zeros(size + 1, *shape, device=device)  # the last row receives discarded windows
        self._next = torch.zeros((), dtype=torch.long, device=device)
        self._count = torch.zeros((), dtype=torch.long, device=device)

    @property
    def count(self) -> int:
        """Number of windows; synchronizes with the GPU."""
        return int(self._count)

    def insert(self, windows: torch.Tensor, kept: torch.Tensor) -> None:
        """Insert the windows (n, h, f) marked by `kept` (n,), overwriting the oldest when full."""
        windows, kept = windows[-self._size :], kept[-self._size :]
        at = (self._next + kept.cumsum(dim=0) - 1) % self._size
        self._windows[torch.where(kept, at, self._size)] = windows
        self._next.copy_((self._next + kept.sum()) % self._size)
        self._count.copy_((self._count + kept.sum()).clamp(max=self._size))

    def draw(self, count: int) -> torch.Tensor:
        """Draw windows uniformly with replacement; the buffer must not be empty."""
        share = torch.rand(count, dtype=torch.float64, device=self._windows.device)
        return self._windows[(share * self._count).long()]
