"""Checkpoints: written atomically, read with `weights_only=True`, so that loading runs no code."""

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
REMOVE = "Remove the file and repeat the command: it continues from the previous checkpoint."
MAX_BYTES = 384_000_000
"""Largest checkpoint: actor and critic, each at most the size of a policy, and two Adam moments per parameter."""


def save_checkpoint(folder: Path, iteration: int, state: dict[str, Any], environment_steps: int) -> Path:
    """Write a checkpoint atomically and return its path.

    Args:
        folder: folder of the checkpoints
        iteration: finished iterations
        state: state dictionaries and further values
        environment_steps: control steps of each environment

    Raises TrainingError if the file can't be written.
    """
    path = folder / f"model_{iteration:06d}.pt"
    part = path.with_suffix(".part")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        torch.save({**state, "iteration": iteration, "environment_steps": environment_steps}, part)
        part.replace(path)
    except (OSError, RuntimeError) as error:  # PyTorch raises RuntimeError for a full disk
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise TrainingError(f"{path}: could not be written ({_first_line(error)}). Is the disk full?") from error
    return path


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def load_checkpoint(path: Path, device: str) -> dict[str, Any]:
    """Read the state of a checkpoint.

    Raises TrainingError if the file can't be read, does not fit in the device's memory, is not a checkpoint, exceeds
    `MAX_BYTES`, or contains more than tensors and numbers.
    """
    try:
        check_torch_archive(path, MAX_BYTES)
        state = torch.load(path, map_location=device, weights_only=True)
    except FileError as error:
        raise _not_loaded(path, error.problem.rstrip(".")) from error
    except OSError as error:
        raise TrainingError(f"{path}: can't be read ({error.strerror or error}).") from error
    except (MemoryError, torch.OutOfMemoryError) as error:
        problem = f"{device} has too little free memory to load it; end other programs there."
        raise TrainingError(f"{path}: {problem}") from error
    except Exception as error:  # parsers of damaged archives and pickles raise various exceptions
        raise _not_loaded(path, _first_line(error)) from error
    missing = [part for part in PARTS if not isinstance(state, dict) or part not in state]
    if missing:
        raise _not_loaded(path, f"lacks {', '.join(missing)}")
    wrong = [part for part in STATES if not isinstance(state[part], dict)]
    wrong += [part for part in COUNTS if type(state[part]) is not int or state[part] < 0]
    if wrong:
        raise _not_loaded(path, f"invalid {', '.join(wrong)}")
    return state


def _not_loaded(path: Path, reason: str) -> TrainingError:
    problem = f"is not a checkpoint of this project and was not loaded ({reason})"
    return TrainingError(f"{path}: {problem}. {REMOVE}")


def newest_checkpoint(folder: Path) -> Path | None:
    """The checkpoint with the most iterations in a folder; None if there is none."""
    paths = [path for path in folder.glob("model_*.pt") if NAME.match(path.name)]
    return max(paths, default=None, key=lambda path: path.name)
