"""Checkpoints: written whole, read with `weights_only=True`, so that none can run code."""

import contextlib
import re
from pathlib import Path
from typing import Any

import torch

from pipeline.errors import FileError
from pipeline.files.npz import check_torch_archive
from pipeline.learning.training_error import TrainingError

NAME = re.compile(r"^model_(\d{6})\.pt$")
STATES = ("actor_state_dict", "critic_state_dict", "optimizer_state_dict")
COUNTS = ("iteration", "environment_steps")
PARTS = (*STATES, *COUNTS)
REMOVE = "Remove the file and repeat the command: it continues from the checkpoint before."
MOST_BYTES = 384_000_000
"""Of a checkpoint: actor and critic, each a network of at most the size of a policy, and two moments of Adam for each
parameter."""


def save_checkpoint(folder: Path, iteration: int, state: dict[str, Any], environment_steps: int) -> Path:
    """Write the state after some iterations, whole or not at all. Raises TrainingError where the disk refuses."""
    path = folder / f"model_{iteration:06d}.pt"
    part = path.with_suffix(".part")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        torch.save({**state, "iteration": iteration, "environment_steps": environment_steps}, part)
        part.replace(path)
    except (OSError, RuntimeError) as error:  # of a full disk PyTorch says RuntimeError
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise TrainingError(f"{path}: could not be written ({_first_line(error)}). Is the disk full?") from error
    return path


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def load_checkpoint(path: Path, device: str) -> dict[str, Any]:
    """The state of a file. Raises TrainingError where it can't be read, the device has no memory for it, it is no
    checkpoint, is larger than `MOST_BYTES`, or holds more than tensors and numbers."""
    try:
        check_torch_archive(path, MOST_BYTES)
        state = torch.load(path, map_location=device, weights_only=True)
    except FileError as error:
        problem = f"is no checkpoint of ours and was not loaded ({error.problem.rstrip('.')}). {REMOVE}"
        raise TrainingError(f"{path}: {problem}") from error
    except OSError as error:
        raise TrainingError(f"{path}: can't be read ({error.strerror or error}).") from error
    except (MemoryError, torch.OutOfMemoryError) as error:
        problem = f"there is no memory left on {device} to load it; end what else runs there."
        raise TrainingError(f"{path}: {problem}") from error
    except Exception as error:  # a damaged archive or pickle raises whatever a parser on its way does
        problem = f"is no checkpoint of ours and was not loaded ({_first_line(error)}). {REMOVE}"
        raise TrainingError(f"{path}: {problem}") from error
    missing = [part for part in PARTS if not isinstance(state, dict) or part not in state]
    if missing:
        raise TrainingError(f"{path}: lacks {', '.join(missing)}; it is no checkpoint of ours.")
    wrong = [part for part in STATES if not isinstance(state[part], dict)]
    wrong += [part for part in COUNTS if type(state[part]) is not int or state[part] < 0]
    if wrong:
        raise TrainingError(f"{path}: {', '.join(wrong)} of another kind; it is no checkpoint of ours.")
    return state


def newest_checkpoint(folder: Path) -> Path | None:
    """The checkpoint of most iterations in a folder; None where there is none."""
    found = [path for path in folder.glob("model_*.pt") if NAME.match(path.name)]
    return max(found, default=None, key=lambda path: path.name)
