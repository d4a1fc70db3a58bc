"""Ring buffer of the newest labelled states."""

import torch


class LabelledStates:
    """Ring buffer of observations (m, o), in half precision, and the teacher's actions (m, a)."""

    def __init__(self, size: int, observations: int, actions: int, device: str):
        self._observation = torch.zeros(size, observations, dtype=torch.float16, device=device)
        self._action = torch.zeros(size, actions, device=device)
        self._next, self.filled = 0, 0
        """Number of stored states."""

    def add(self, observation: torch.Tensor, action: torch.Tensor) -> None:
        """Insert states (n, o) with labels (n, a), overwriting the oldest; if n exceeds the size, the last ones."""
        size = len(self._observation)
        observation, action = observation[-size:], action[-size:]
        at = (self._next + torch.arange(len(observation), device=observation.device)) % size
        self._observation[at], self._action[at] = observation.half(), action
        self._next = (self._next + len(observation)) % size
        self.filled = min(size, self.filled + len(observation))

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Draw states and labels uniformly with replacement."""
        at = torch.randint(self.filled, (count,), device=self._observation.device)
        return self._observation[at].float(), self._action[at]
