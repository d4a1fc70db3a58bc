"""A ring of policy windows."""

import torch

SIZE = 500_000
"""Windows that are kept (paper); fewer with fewer than 4096 environments."""


class Replay:
    """A ring of policy windows (m, h, f); its position and fill are known on the device alone."""

    def __init__(self, size: int, shape: tuple[int, int], device: str):
        self._size = size
        self._windows = torch.zeros(size + 1, *shape, device=device)  # the last row takes what is not kept
        self._next = torch.zeros((), dtype=torch.long, device=device)
        self._count = torch.zeros((), dtype=torch.long, device=device)

    @property
    def count(self) -> int:
        """Number of windows. The processor waits for it."""
        return int(self._count)

    def insert(self, windows: torch.Tensor, kept: torch.Tensor) -> None:
        """Insert those of the windows (n, h, f) that are `kept` (n,), over the oldest ones when it is full."""
        windows, kept = windows[-self._size :], kept[-self._size :]
        at = (self._next + kept.cumsum(dim=0) - 1) % self._size
        self._windows[torch.where(kept, at, self._size)] = windows
        self._next.copy_((self._next + kept.sum()) % self._size)
        self._count.copy_((self._count + kept.sum()).clamp(max=self._size))

    def draw(self, count: int) -> torch.Tensor:
        """Windows drawn uniformly with repetition from a ring that is not empty."""
        share = torch.rand(count, dtype=torch.float64, device=self._windows.device)
        return self._windows[(share * self._count).long()]
