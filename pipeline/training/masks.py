"""States of some environments changed in place: masks, which a GPU reads itself, instead of indices, for whose number a
processor would wait; and the same memory at every step, which `captured.py` asks for."""

from __future__ import annotations

import torch


def replace(state: torch.Tensor, mask: torch.Tensor, value: torch.Tensor | float) -> None:
    """Put the rows of `value`, like `state` (n, ...), into those rows of `state` where `mask` (n,) is set."""
    rows = mask.view(-1, *[1] * (state.ndim - 1))
    if isinstance(value, torch.Tensor):
        state.copy_(torch.where(rows, value, state))
    else:
        state.masked_fill_(rows, value)


def members(env_ids: torch.Tensor, count: int) -> torch.Tensor:
    """The mask (count,) of some of `count` environments."""
    mask = torch.zeros(count, dtype=torch.bool, device=env_ids.device)
    mask[env_ids] = True
    return mask
