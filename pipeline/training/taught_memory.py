"""The newest states that teachers have spoken of, in a ring."""

from __future__ import annotations

import torch


class TaughtMemory:
    """What was seen (m, o) and what was told (m, a); the oldest go first. What is seen is kept in half precision."""

    def __init__(self, size: int, seen: int, told: int, device: str):
        self._seen = torch.zeros(size, seen, dtype=torch.float16, device=device)
        self._told = torch.zeros(size, told, device=device)
        self._next, self.filled = 0, 0
        """How many are in it."""

    def add(self, seen: torch.Tensor, told: torch.Tensor) -> None:
        """Put states (n, o) and what was told of them (n, a) in the places of the oldest; the last of them if
        they are too many."""
        size = len(self._seen)
        seen, told = seen[-size:], told[-size:]
        at = (self._next + torch.arange(len(seen), device=seen.device)) % size
        self._seen[at], self._told[at] = seen.half(), told
        self._next = (self._next + len(seen)) % size
        self.filled = min(size, self.filled + len(seen))

    def drawn(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Some of those in it, any as likely as any other."""
        at = torch.randint(self.filled, (count,), device=self._seen.device)
        return self._seen[at].float(), self._told[at]
