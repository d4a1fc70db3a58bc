"""States of some environments changed in place, by masks.

A GPU reads a mask itself; for indices the processor would wait for their number. Memory stays the same at every step,
as `captured.py` requires.
"""

import torch


def replace(state: torch.Tensor, mask: torch.Tensor, value: torch.Tensor | float) -> None:
    """Copy the rows of `value`, shaped like `state` (n, ...), into the rows of `state` where `mask` (n,) is set."""
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
