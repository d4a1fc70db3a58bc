"""Shared by the training commands: arguments, start, exit status, commit, device, and the JSON files of a run."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from pipeline.errors import PipelineError
from pipeline.learning.training_error import TrainingError

PACKAGES = ("mjlab", "mujoco", "mujoco-warp", "numpy", "rsl-rl-lib", "torch", "warp-lang")
"""Packages whose versions affect training results."""


def exit_status(train: Callable[[], None], interrupted: str) -> int:
    """Run `train`; return 0 on success, 2 after an error of this project (printed), 130 after an interrupt.

    Args:
        train: function to run
        interrupted: printed hint how to continue an interrupted run
    """
    try:
        train()
    except (TrainingError, PipelineError) as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"interrupted; {interrupted}", file=sys.stderr)
        return 130
    return 0


def device_name(device: str) -> str:
    """Name of the GPU, or `cpu`."""
    import torch  # slow import, not needed for `--help`

    return torch.cuda.get_device_name(device) if device.startswith("cuda") else "cpu"


def started_module(name: str, gpus: int) -> list[str]:
    """Python arguments that start a module; with several GPUs, by torchrun."""
    if gpus == 1:
        return ["-m", name]
    return ["-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={gpus}", "-m", name]


def commit_of(root: Path) -> str:
    """Git commit of the code in `root`, with `+` if files are modified; empty outside a repository."""
    try:
        head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=True)
        state = ["git", "status", "--porcelain", "--untracked-files=no"]
        changed = subprocess.run(state, cwd=root, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return head.stdout.strip() + ("+" if changed.stdout.strip() else "")


def versions() -> dict[str, str]:
    """Versions of Python and of `PACKAGES`; `not stated` for a package without metadata."""
    versions_by_name = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions_by_name[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions_by_name[name] = "not stated"
    return versions_by_name


def write_json(path: Path, value: dict[str, Any]) -> None:
    """Write a JSON file atomically. Raises TrainingError if it can't be written."""
    part = path.with_suffix(".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(value, indent=1, sort_keys=True) + "\n")
        part.replace(path)
    except OSError as error:
        raise TrainingError(f"{path}: could not be written ({error.strerror or error}). Is the disk full?") from error


def chosen_device(name: str) -> str:
    """Resolve a device name; under torchrun, to the GPU of this process. Raises TrainingError if it does not exist."""
    import torch

    if name == "cpu":
        if int(os.getenv("WORLD_SIZE", "1")) > 1:
            raise TrainingError(
                "--device is 'cpu', but torchrun is for several GPUs. Start one process without torchrun."
            )
        return name
    if not torch.cuda.is_available():
        raise TrainingError(f"--device is '{name}', but PyTorch finds no GPU here. Use --device cpu.")
    if name != "cuda" and int(os.getenv("WORLD_SIZE", "1")) > 1:
        raise TrainingError(f"--device is '{name}', but torchrun gives each process its own GPU. Use --device cuda.")
    name, count = f"cuda:{os.getenv('LOCAL_RANK', '0')}" if name == "cuda" else name, torch.cuda.device_count()
    if name not in [f"cuda:{index}" for index in range(count)]:
        do = f"Use --device cuda, and at most {count} of torchrun's processes (--nproc-per-node)."
        raise TrainingError(f"there is no device '{name}': PyTorch finds cuda:0 to cuda:{count - 1} here. {do}")
    torch.cuda.set_device(name)
    return name


def pairs(texts: Sequence[str]) -> dict[str, str]:
    """Parse texts NAME=VALUE into a dictionary. Raises TrainingError for another form."""
    for text in texts:
        if "=" not in text:
            raise TrainingError(f"--set is '{text}'; it must be NAME=VALUE.")
    return dict(text.split("=", 1) for text in texts)
