"""The newest states that the teacher has labelled, in a ring."""

import torch


class LabelledStates:
    """Observations (m, o), kept in half precision, and the teacher's actions (m, a); the oldest are overwritten."""

    def __init__(self, size: int, observations: int, actions: int, device: str):
        self._observation = torch.zeros(size, observations, dtype=torch.float16, device=device)
        self._action = torch.zeros(size, actions, device=device)
        self._next, self.filled = 0, 0
        """Number of states in it."""

    def add(self, observation: torch.Tensor, action: torch.Tensor) -> None:
        """Insert states (n, o) with their labels (n, a) over the oldest ones; the last of them if they are too many."""
        size = len(self._observation)
        observation, action = observation[-size:], action[-size:]
        at = (self._next + torch.arange(len(observation), device=observation.device)) % size
        self._observation[at], self._action[at] = observation.half(), action
        self._next = (self._next + len(observation)) % size
        self.filled = min(size, self.filled + len(observation))

    def draw(self, count: int) -> tuple[torch.Tensor, torch.Tensor]:
        """States and labels, drawn uniformly with repetition."""
        at = torch.randint(self.filled, (count,), device=self._observation.device)
        return self._observation[at].float(), self._action[at]
