"""What commands that train make of their arguments."""

from __future__ import annotations

import os
from collections.abc import Sequence

from pipeline.learning.training_error import TrainingError


def chosen_device(name: str) -> str:
    """The device, of the process's own rank under torchrun. Raises TrainingError where it is not there."""
    import torch

    if name == "cpu":
        return name
    if not torch.cuda.is_available():
        raise TrainingError(f"--device is '{name}', but PyTorch finds no GPU here. Use --device cpu.")
    name = f"cuda:{os.getenv('LOCAL_RANK', '0')}" if name == "cuda" else name
    torch.cuda.set_device(name)
    return name


def pairs(texts: Sequence[str], of: str = "--set") -> dict[str, str]:
    """Texts NAME=VALUE by name. Raises TrainingError for another form."""
    for text in texts:
        if "=" not in text:
            raise TrainingError(f"{of} is '{text}'; it must be NAME=VALUE.")
    return dict(text.split("=", 1) for text in texts)
