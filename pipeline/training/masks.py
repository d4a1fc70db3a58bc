"""In-place updates of some environments, selected by masks.

Masks stay on the GPU, whereas the CPU would have to wait for the number of indices. Tensors keep their memory, as
`captured.py` requires.
"""

import torch


def replace(state: torch.Tensor, mask: torch.Tensor, value: torch.Tensor | float) -> None:
    """Copy the rows of `value`, shaped like `state` (n, ...), into the rows of `state` where `mask` (n,) is set."""
    rows = mask.view(-1, *[1] * (state.ndim - 1))
    if isinstance(value, torch.Tensor):
        state.copy_(torch.where(rows, value, state))
    else:
        state.masked_fill_(rows, value)


def mask_of_indices(env_ids: torch.Tensor, count: int) -> torch.Tensor:
    """Convert environment indices to a mask (count,)."""
    mask = torch.zeros(count, dtype=torch.bool, device=env_ids.device)
    mask[env_ids] = True
    return mask
