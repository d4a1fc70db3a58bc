"""A training run in a process of its own: one at a time on this machine's GPUs, taken up where it was left."""

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol

import dagster as dg

from pipeline.errors import PipelineError
from pipeline.files import digest
from pipeline.training.presets import DEFAULT

LOG_EVERY_S = 10.0
"""How often a line of progress goes into the log at most."""
TRIAL_ENVS, TRIAL_ITERATIONS = 8, 2
"""What is trained where there is no GPU: enough to see that training runs."""
REFINING_ENVS, REFINING_ITERATIONS = 512, 1500
"""What a processor trains with where it goes on from a policy."""
TRIAL_OPTIONS = ("expert_windows=2000", "replay_windows=2000", "discriminator_batch=64")
"""Options of a trial, for which full buffers would only take memory."""


class TrainingFailedError(PipelineError):
    """The training process ended with an error; its last lines are told."""


class TrainingConfig(dg.Config):
    """What is trained, and on what."""

    preset: str = DEFAULT
    """Of pipeline/training/presets.py."""
    options: list[str] = []  # noqa: RUF012, a field
    """Single options that differ from the preset, as `name=value`."""
    seed: int = 1
    device: str = "auto"
    """`cuda`, `cpu`, or `auto`: the GPU where there is one, else the CPU; there it is a trial, but for `start_from`."""
    start_from: str = ""
    """A policy file (npz) to go on from, with the preset `refined_steps`: absolute, or from where Dagster runs. Then a
    processor trains in earnest."""
    gpus: int = 1
    """Processes, each on a GPU of its own, with `num_envs` environments each."""
    num_envs: int = 0
    """0: 4096 on a GPU, 512 on a processor that goes on from a policy, 8 in a trial."""
    iterations: int = 0
    """0: 1500, or 2 in a trial."""
    minutes: float = 20.0
    """Training ends after this time at the latest."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """One training run as it is asked for."""

    folder: Path
    bundle: Path
    preset: str
    options: tuple[str, ...]
    seed: int
    device: str
    gpus: int
    num_envs: int
    iterations: int
    minutes: float
    trial: bool
    """A few iterations on the CPU: no policy comes of it."""
    start_from: Path | None = None
    """The policy that is gone on with."""

    @property
    def command(self) -> list[str]:
        """The command, without the Python that runs it."""
        module = ["-m", "pipeline.training"]
        if self.gpus > 1:
            module = ["-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={self.gpus}", *module]
        given = {
            "bundle": self.bundle,
            "out": self.folder,
            "preset": self.preset,
            "device": self.device,
            "num-envs": self.num_envs,
            "iterations": self.iterations,
            "minutes": f"{self.minutes:g}",
            "seed": self.seed,
        }
        if self.start_from is not None:
            given["start-from"] = self.start_from
        arguments = [text for name, value in given.items() for text in (f"--{name}", str(value))]
        return [*module, *arguments, *(text for each in self.options for text in ("--set", each)), "--resume"]

    @property
    def done(self) -> bool:
        """Whether it ended by itself."""
        return (self.folder / "done.json").is_file()


def run_of(config: TrainingConfig, runs: Path, bundle: Path, bundle_digest: str, options: Sequence[str] = ()) -> Run:
    """The run that a config asks for on this machine; equal questions have the same folder, and go on in it.

    Raises TrainingFailedError where a GPU is asked for and none is there, or a policy to go on from.
    """
    there = gpus_here()
    if config.device == "cuda" and there < config.gpus:
        raise TrainingFailedError(
            f"{config.gpus} GPUs are asked for, {there} are here; set the device to 'cpu' or 'auto'."
        )
    device = config.device if config.device != "auto" else "cuda" if there else "cpu"
    start_from = Path(config.start_from).resolve() if config.start_from else None
    if start_from is not None and not start_from.is_file():
        raise TrainingFailedError(f"{start_from}: there is no such policy to go on from; 'start_from' names an npz.")
    trial = device == "cpu" and start_from is None
    envs, iterations = _size(device, trial)
    asked = (*options, *config.options)
    told: dict[str, Any] = {
        "preset": config.preset,
        "options": (*TRIAL_OPTIONS, *asked) if trial else asked,
        "seed": config.seed,
        "device": device,
        "gpus": 1 if device == "cpu" else config.gpus,
        "num_envs": config.num_envs or envs,
        "iterations": config.iterations or iterations,
        "minutes": config.minutes,
        "trial": trial,
    }
    given = [digest.of_file(start_from)] if start_from is not None else []
    name = digest.of_json([bundle_digest, {**told, "options": list(told["options"])}, *given])[:10]
    kind = "trial-" if trial else ""
    folder = runs / f"{kind}{config.preset}-seed{config.seed}-{name}"
    return Run(folder=folder, bundle=bundle, start_from=start_from, **told)


def _size(device: str, trial: bool) -> tuple[int, int]:
    """Environments and iterations where none are asked for."""
    if trial:
        return TRIAL_ENVS, TRIAL_ITERATIONS
    return (REFINING_ENVS, REFINING_ITERATIONS) if device == "cpu" else (4096, 1500)


def gpus_here() -> int:
    """How many GPUs PyTorch finds."""
    import torch

    return torch.cuda.device_count() if torch.cuda.is_available() else 0


class TrainingCommand(Protocol):
    """A training run that a process of its own works on."""

    @property
    def folder(self) -> Path: ...

    @property
    def command(self) -> list[str]: ...

    @property
    def done(self) -> bool: ...


def train(run: TrainingCommand, root: Path, lock: Path, log: Any) -> None:
    """Train until the run is done; nothing where it is. Raises TrainingFailedError."""
    if run.done:
        log.info(f"{run.folder.name} is done already: nothing is trained")
        return
    run.folder.mkdir(parents=True, exist_ok=True)
    with _alone(lock, log) as held:
        log.info(f"training in a process of its own: python {' '.join(run.command)}")
        _follow([sys.executable, *run.command], root, held, log)
    if not run.done:
        raise TrainingFailedError(f"{run.folder}: training ended without done.json. Materialize again to take it up.")


def _follow(command: list[str], root: Path, held: IO[str], log: Any) -> None:
    """Run a command to its end. It inherits the lock, so that a GPU stays taken as long as the process lives."""
    process = subprocess.Popen(
        command,
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        pass_fds=(held.fileno(),),
        start_new_session=True,
    )
    assert process.stdout is not None
    last: list[str] = []
    told = 0.0
    try:
        for line in process.stdout:
            last = [*last[-19:], line.rstrip()]
            if line.startswith("iteration ") and time.monotonic() - told > LOG_EVERY_S:
                told = time.monotonic()
                log.info(line.rstrip())
    finally:
        _end(process)
    if last and last[-1].startswith("iteration "):
        log.info(last[-1])
    if process.returncode != 0:
        lines = "\n".join(last)
        raise TrainingFailedError(f"training ended with status {process.returncode}. Its last lines:\n{lines}")


def _end(process: subprocess.Popen[str]) -> None:
    """Wait for the process; where this one is being stopped, end it first, with all that it started."""
    if sys.exc_info()[0] is None:
        process.wait()
        return
    for number, patience_s in ((signal.SIGINT, 30.0), (signal.SIGKILL, 10.0)):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(patience_s)
            except subprocess.TimeoutExpired:
                continue


@contextmanager
def _alone(path: Path, log: Any) -> Iterator[IO[str]]:
    """A lock that one training on this project's machine holds; the system releases it when the last holder dies."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            log.info("waiting for another training to end")
            fcntl.flock(stream, fcntl.LOCK_EX)
        yield stream


def policy_of_checkpoint(run: Run, checkpoint: Path, root: Path) -> Path:
    """The npz of a checkpoint, made by training's own command where it isn't there yet. Raises TrainingFailedError."""
    path = run.folder / "policies" / f"{checkpoint.stem}.npz"
    if not path.is_file():
        module = [sys.executable, "-m", "pipeline.training.export_policy"]
        given = ["--checkpoint", str(checkpoint), "--bundle", str(run.bundle), "--out", str(path)]
        done = subprocess.run([*module, *given], cwd=root, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise TrainingFailedError(f"{checkpoint}: no policy came of it. {done.stderr.strip()}")
    return path
