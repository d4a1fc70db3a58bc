"""A training stage: its folder, files and duration.

<folder>/checkpoints/model_000100.pt   every 100 iterations and the last; read with `weights_only=True`
<folder>/curves.csv                    one row per iteration
<folder>/policy.npz                    the newest checkpoint's network with its gains
<folder>/done.json                     written last, after the final iteration
"""

import os
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint, save_checkpoint
from pipeline.learning.curves_file import CurvesFile
from pipeline.learning.policy_file import policy_arrays, write_policy
from pipeline.learning.run_command import write_json
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import Bundle
from pipeline.training.config import Config

SAVE_EVERY = 100
"""Iterations between checkpoints."""
STEPS = 24
"""Control steps of each environment per iteration."""
CHECKPOINTS, CURVES, POLICY, DONE = "checkpoints", "curves.csv", "policy.npz", "done.json"


@dataclass(frozen=True, kw_only=True)
class Request:
    """Parameters of a run and its output folder."""

    out: Path
    preset: str
    config: Config
    device: str
    seed: int
    physics: str | None = None
    """`warp` or `plain`; None: the faster one on the device."""


class Stage(ABC):
    """One stage in its folder; `run` continues from the newest checkpoint."""

    def __init__(self, bundle: Bundle, request: Request, folder: Path, iterations: int):
        self.bundle, self.request, self.folder, self._iterations = bundle, request, folder, iterations
        self.rank, self.world = int(os.getenv("RANK", "0")), int(os.getenv("WORLD_SIZE", "1"))
        self.iteration, self.environment_steps = 0, 0
        """Finished iterations, and control steps of each environment."""
        self.resumed_at: list[int] = []
        """Iterations at which the run was resumed."""
        self._started = time.monotonic()  # includes building the environment and its kernels

    @abstractmethod
    def iterate(self, share: float) -> dict[str, float]:
        """Run one iteration; `share` (0 to 1) is the finished part of the stage. Returns columns of `curves.csv`."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """State to save in a checkpoint."""

    @abstractmethod
    def load(self, state: dict[str, Any]) -> None:
        """Restore the state of a checkpoint."""

    @abstractmethod
    def line(self, row: dict[str, float]) -> str:
        """Format a row of `curves.csv` for the progress line."""

    def run(self) -> None:
        """Run the remaining iterations."""
        self._resume()
        self.folder.mkdir(parents=True, exist_ok=True)
        curves = CurvesFile(self.folder / CURVES, self.iteration)
        before, first, compiled = curves.seconds, self.iteration + 1, 0.0
        while self.iteration < self._iterations:
            began = time.monotonic()
            figures = self.iterate(self.iteration / self._iterations)
            self.iteration += 1
            now = time.monotonic()
            if self.iteration == first:  # the first iteration includes compilation, so its duration is excluded
                compiled = now
            pace_s = (now - compiled) / (self.iteration - first) if self.iteration > first else None
            row = self._row(figures, before + now - self._started, now - began)
            if self.rank == 0:
                curves.add(row)
                print(f"{self._head(row, pace_s)}: {self.line(row)}, {row['steps_per_s']:.0f} steps/s", flush=True)
                if self.iteration % 10 == 0 or self.iteration < 10:
                    curves.write()
                if self.iteration % SAVE_EVERY == 0:
                    self._save(curves)
        if self.rank == 0:
            self._save(curves)
            self._finish(before + time.monotonic() - self._started)

    def _row(self, figures: dict[str, float], seconds: float, duration_s: float) -> dict[str, float]:
        steps = self.request.config.simulation.num_envs * STEPS * self._workers
        return {"iteration": self.iteration, "seconds": seconds, "steps_per_s": steps / duration_s, **figures}

    @property
    def _workers(self) -> int:
        """Processes that step environments in this stage."""
        return self.world

    def _head(self, row: dict[str, float], pace_s: float | None) -> str:
        """Progress, with the time left at `pace_s` [s] per iteration."""
        progress = f"iteration {self.iteration} of {self._iterations} of {self.folder.name}, {row['seconds']:.0f} s"
        if pace_s is None:
            return progress
        return f"{progress}, {(self._iterations - self.iteration) * pace_s / 60.0:.1f} min left"

    def _resume(self) -> None:
        path = newest_checkpoint(self.folder / CHECKPOINTS)
        if path is None:
            return
        state = load_checkpoint(path, self.request.device)
        try:
            self.load(state)
            self.resumed_at = [*map(int, state.get("resumed_at", []))]
            if int(state["iteration"]) < self._iterations:  # else no iteration is left, and the network is unchanged
                self.resumed_at.append(int(state["iteration"]))
        except torch.OutOfMemoryError:
            raise  # the checkpoint is valid; the command prints what to do
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            first = str(error).splitlines()[0]
            raise TrainingError(
                f"{path}: has another network or other settings and can't be resumed ({first}). Give another --out."
            ) from error
        self.iteration, self.environment_steps = int(state["iteration"]), int(state["environment_steps"])

    def _save(self, curves: CurvesFile) -> None:
        """Save a checkpoint and the policy. Raises TrainingError, and saves neither, if the network diverged."""
        state = self.state() | {"resumed_at": self.resumed_at}
        try:
            arrays = policy_arrays(state, self.bundle.robot)
        except TrainingError as error:
            do = "Repeating the command continues from the previous checkpoint."
            raise TrainingError(f"{self.folder}, iteration {self.iteration}: {error} {do}") from error
        save_checkpoint(self.folder / CHECKPOINTS, self.iteration, state, self.environment_steps)
        write_policy(self.folder / POLICY, arrays)
        curves.write()

    def _finish(self, seconds: float) -> None:
        steps = self.iteration * self.request.config.simulation.num_envs * STEPS * self._workers
        done = {"iterations": self.iteration, "seconds": seconds, "steps": steps, "resumed_at": self.resumed_at}
        done["gpu_seconds"] = 0.0 if self.request.device == "cpu" else seconds * self.world  # waiting GPUs count too
        write_json(self.folder / DONE, {**done, "steps_per_s": steps / max(seconds, 1e-9)})
