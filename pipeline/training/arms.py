"""Training runs side by side, one a GPU, and what they left so far.

Below one folder: `<arm>/` is the folder of a run as `python -m pipeline.training` writes it, with `policies/`
(checkpoints as npz) and `sweeps/` (their figures); `<arm>/lock` is held by the run's process as long as it lives.
"""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.learning.checkpoint import NAME
from pipeline.learning.training_error import TrainingError

THREADS = 4
"""Of a training process on the host."""
RESTARTS = 2
"""How often a run that broke off is taken up again."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One run as it is asked for."""

    name: str
    seed: int
    options: tuple[str, ...] = ()
    """Options that differ from the preset, as `name=value`."""


@dataclass(frozen=True, kw_only=True)
class ArmsRequest:
    """What is asked of all of them."""

    bundle: Path
    out: Path
    preset: str
    arms: tuple[Arm, ...]
    device: str
    gpus: int
    num_envs: int
    iterations: int
    minutes: float | None
    options: tuple[str, ...] = ()
    start_from: Path | None = None
    """A policy file that all of them go on from."""

    def folder(self, arm: Arm) -> Path:
        """Where an arm's run lies."""
        return self.out / arm.name

    def command(self, arm: Arm) -> list[str]:
        """What trains an arm, without the Python that runs it; goes on where it was left."""
        given = {
            "bundle": self.bundle,
            "out": self.folder(arm),
            "preset": self.preset,
            "device": self.device,
            "num-envs": self.num_envs,
            "iterations": self.iterations,
            "seed": arm.seed,
        }
        given |= {} if self.minutes is None else {"minutes": f"{self.minutes:g}"}
        given |= {} if self.start_from is None else {"start-from": self.start_from}
        texts = [text for name, value in given.items() for text in (f"--{name}", str(value))]
        options = [text for each in (*self.options, *arm.options) for text in ("--set", each)]
        return ["-m", "pipeline.training", *texts, *options, "--resume"]

    def check(self) -> None:
        """Raises TrainingError where arms share a name, or the folder has other runs under these names."""
        names = [arm.name for arm in self.arms]
        if len(set(names)) < len(names) or not names:
            raise TrainingError(f"the arms are {', '.join(names) or 'none'}; each needs a name of its own.")
        for arm in self.arms:
            path = self.folder(arm) / "command.json"
            if path.is_file() and json.loads(path.read_text()) != self.command(arm):
                raise TrainingError(f"{self.folder(arm)}: is another run's folder. Give --out another folder.")


@dataclass(kw_only=True)
class ArmProcess:
    """An arm's process, started here or found running."""

    request: ArmsRequest
    arm: Arm
    number: int
    """Counts the arms; says which GPU is its own."""
    starts: int = 0
    process: subprocess.Popen | None = field(default=None, repr=False)

    @property
    def folder(self) -> Path:
        return self.request.folder(self.arm)

    @property
    def done(self) -> bool:
        """Whether the run ended by itself."""
        return (self.folder / "done.json").is_file()

    @property
    def failed(self) -> bool:
        """Whether it broke off too often."""
        return not self.done and self.starts > RESTARTS and not self.running()

    def running(self) -> bool:
        """Whether a process trains it, this program's or one of before."""
        if self.process is not None and self.process.poll() is not None:
            self.process = None
        if self.process is not None:
            return True
        path = self.folder / "lock"
        if not path.is_file():
            return False
        with path.open("a") as stream:
            return not _locked(stream)

    def keep_going(self) -> None:
        """Start it where it is neither done nor running, as often as is allowed."""
        if self.done or self.running() or self.starts > RESTARTS:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        write_json(self.folder / "command.json", self.request.command(self.arm))
        self.starts += 1
        with (self.folder / "lock").open("a") as lock, (self.folder / "log.txt").open("a") as log:
            if not _locked(lock):
                return
            self.process = subprocess.Popen(
                [sys.executable, *self.request.command(self.arm)],
                env=self._environment(),
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                pass_fds=(lock.fileno(),),
                start_new_session=True,
            )

    def _environment(self) -> dict[str, str]:
        quiet = {"MUJOCO_GL": "disable", "PYTHONUNBUFFERED": "1", "OMP_NUM_THREADS": str(THREADS)}
        given = os.environ.get("CUDA_VISIBLE_DEVICES", "")
        there = given.split(",") if given else [str(number) for number in range(self.request.gpus)]
        own = {"CUDA_VISIBLE_DEVICES": there[self.number % self.request.gpus]} if self.request.gpus else {}
        return {**os.environ, **quiet, **own}

    def stop(self) -> None:
        """Interrupt it; its newest checkpoint is what is left."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(30.0)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def checkpoints(self) -> list[Path]:
        """Its checkpoints, the oldest first."""
        return sorted(path for path in (self.folder / "checkpoints").glob("model_*.pt") if NAME.match(path.name))

    def last_line(self) -> str:
        """What it said last of its progress."""
        path = self.folder / "log.txt"
        lines = path.read_text(errors="replace").splitlines() if path.is_file() else []
        said = [line for line in lines if line.startswith("iteration ")]
        return said[-1] if said else (lines[-1] if lines else "nothing said yet")


def _locked(stream: Any) -> bool:
    """Whether the lock on an open file could be taken."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def write_json(path: Path, value: Any) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(json.dumps(value, indent=1, sort_keys=True) + "\n")
    part.replace(path)
