"""What one network learns from: the newest states, any of them as likely as any other."""

from __future__ import annotations

import torch

from pipeline.training.taught_memory import TaughtMemory


def states(*values: int) -> tuple[torch.Tensor, torch.Tensor]:
    """State v: 2 v and 2 v + 1 are seen of it, 10 v is told."""
    value = torch.tensor(values, dtype=torch.float32)[:, None]
    return torch.cat([2.0 * value, 2.0 * value + 1.0], dim=1), 10.0 * value


def held(memory: TaughtMemory) -> set[int]:
    """The states that can be drawn, of many draws."""
    seen, told = memory.drawn(400)
    assert seen.dtype == told.dtype == torch.float32
    value = told[:, 0] / 10.0
    assert torch.equal(seen, torch.stack([2.0 * value, 2.0 * value + 1.0], dim=1))
    return set(value.int().tolist())


def test_the_newest_states_are_remembered():
    torch.manual_seed(0)
    memory = TaughtMemory(5, 2, 1, "cpu")
    for added, filled, kept in (
        ((1, 2), 2, {1, 2}),
        ((3, 4), 4, {1, 2, 3, 4}),
        ((5, 6), 5, {2, 3, 4, 5, 6}),
        ((7, 8, 9), 5, {5, 6, 7, 8, 9}),
        (tuple(range(10, 22)), 5, {17, 18, 19, 20, 21}),
        ((22,), 5, {18, 19, 20, 21, 22}),
    ):
        memory.add(*states(*added))
        assert memory.filled == filled
        assert held(memory) == kept


def test_any_state_is_as_likely_as_any_other():
    torch.manual_seed(0)
    memory = TaughtMemory(50, 2, 1, "cpu")
    memory.add(*states(1, 2, 3, 4))
    _, told = memory.drawn(4000)
    counts = torch.bincount(told[:, 0].long() // 10, minlength=5).tolist()
    assert counts[0] == 0 and min(counts[1:]) > 900
