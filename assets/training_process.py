"""A training run in a process of its own: one at a time on this machine's GPUs; repeated, it continues.

The button `Materialize all` makes everything else and trains nothing (`asked_for`).
"""

import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import dagster as dg
import pandas as pd

from assets.plan import SHARED, Plan
from assets.report import picture, table_of
from pipeline.errors import PipelineError
from pipeline.files import digest
from pipeline.learning.run_command import commit_of, started_module
from pipeline.training.config import DEFAULT, preset

PROGRESS = ("iteration ", "validation: ")
"""How lines of progress begin."""
LOG_EVERY_S = 10.0
"""Shortest time between lines of progress in the log [s]."""
TRIAL_ENVS, TRIAL_ITERATIONS = 8, 2
"""Size of a trial where there is no GPU: enough to see that training runs."""


class TrainingFailedError(PipelineError):
    """The training process ended with an error; its last lines are quoted."""


class TrainingConfig(dg.Config):
    """What is trained, and on what."""

    preset: str = DEFAULT
    """`recipe` or `paper` (pipeline/training/config.py)."""
    options: list[str] = []  # noqa: RUF012, a field
    """Options that differ from the preset, as `group.name=value`."""
    seed: int = 1
    device: str = "auto"
    """`cuda`, `cpu` (a trial of two iterations), or `auto`: the GPU where there is one."""
    gpus: int = 1
    """Processes, each on a GPU of its own."""
    num_envs: int = 0
    """Environments of each process; 0: the preset's, or 8 in a trial."""
    iterations: int = 0
    """Of AMP + PPO, and in a trial of distillation; 0: the preset's, or 2 in a trial."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """A training run as requested, which a process of its own works on."""

    folder: Path
    bundle: Path
    device: str
    command: tuple[str, ...]
    """Without the Python that runs it."""

    @property
    def trial(self) -> bool:
        """Two iterations on the CPU: no policy comes of it."""
        return self.device == "cpu"

    @property
    def done(self) -> bool:
        """Whether it ended by itself."""
        return (self.folder / "done.json").is_file()


def run_in(folder: Path, bundle: Path, module: str, gpus: int, *more: str, **options: Any) -> Run:
    """The run of a module.

    Args:
        folder: folder of its output
        bundle: folder of its training bundle
        module: module to start
        gpus: number of GPUs; a process each
        more: further arguments, after the options, as they are
        options: options as keywords: `device="cpu"` becomes `--device cpu`; `device` is required
    """
    given = {"bundle": bundle, "out": folder, **options}
    words = [text for name, value in given.items() for text in (f"--{name.replace('_', '-')}", str(value))]
    command = (*started_module(module, gpus), *words, *more)
    return Run(folder=folder, bundle=bundle, device=options["device"], command=command)


STAGES = ("distillation", "amp")
"""Stages of a trial; on a CPU training would only distil."""


def run_of(config: TrainingConfig, runs: Path, bundle: Path, bundle_digest: str, options: Sequence[str] = ()) -> Run:
    """The run that a config asks for on this machine; equal requests have the same folder, and continue in it.

    A request is that of the preset's values: where the recipe changes, a new run begins.

    Raises TrainingFailedError where more GPUs are requested than there are, TrainingError for an unknown preset.
    """
    device = device_of(config.device, config.gpus)
    trial = device == "cpu"
    iterations = config.iterations or (TRIAL_ITERATIONS if trial else 0)
    values = preset(config.preset).values()
    distils = values["distillation.iterations"] > 0 and (bundle / "tracker.npz").is_file()
    sizes = {
        "simulation.num_envs": config.num_envs or (TRIAL_ENVS if trial else 0),
        "schedule.iterations": iterations,
    }
    texts = [f"{name}={value}" for name, value in sizes.items() if value]
    if trial:
        texts.append(f"distillation.iterations={iterations if distils else 0}")
    asked: dict[str, Any] = {
        "preset": config.preset,
        "options": [*texts, *options, *config.options],
        "seed": config.seed,
        "device": device,
        "gpus": 1 if trial else config.gpus,
        "trial": trial,
    }
    name = digest.of_json([bundle_digest, values, asked])[:10]
    folder = runs / f"{'trial-' if trial else ''}{config.preset}-seed{config.seed}-{name}"
    more = [text for each in asked["options"] for text in ("--set", each)] + (["--stages", *STAGES] if trial else [])
    given = {name: asked[name] for name in ("device", "seed", "preset")}
    return run_in(folder, bundle, "pipeline.training", asked["gpus"], *more, **given)


def device_of(wanted: str, gpus: int) -> str:
    """`cuda` or `cpu`; for `auto` the GPU where there is one. Raises TrainingFailedError for too many GPUs."""
    there = gpus_here()
    device = wanted if wanted != "auto" else "cuda" if there else "cpu"
    if device == "cuda" and there < gpus:
        raise TrainingFailedError(
            f"{gpus} GPUs are asked for, {there} are here. Ask for fewer, or leave the device at 'auto': without a GPU "
            "that trains a trial."
        )
    return device


def gpus_here() -> int:
    """How many GPUs PyTorch finds."""
    import torch

    return torch.cuda.device_count() if torch.cuda.is_available() else 0


def train(run: Run, root: Path, lock: Path, log: Any) -> None:
    """Train until the run is done; nothing where it is. Raises TrainingFailedError."""
    if run.done:
        log.info(f"{run.folder.name} is done already: nothing is trained")
        trained, now = stated_commit(run.folder), commit_of(Path(__file__).parent)
        if now not in trained:
            log.warning(
                f"it was trained at commit {trained}, the code is at {now}. To train again, remove {run.folder}"
            )
        return
    run.folder.mkdir(parents=True, exist_ok=True)
    with _alone(lock, log) as held:
        log.info(f"training in a process of its own: python {' '.join(run.command)}")
        _follow([sys.executable, *run.command], root, held, log)
    if not run.done:
        raise TrainingFailedError(f"{run.folder}: training ended without done.json. Materialize again to continue it.")


def stated_commit(folder: Path) -> str:
    """The commits of a run, as its `config.json` states them; empty where it states none."""
    path = folder / "config.json"
    return str(json.loads(path.read_text()).get("commit", "")) if path.is_file() else ""


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
    logged = 0.0
    try:
        for line in process.stdout:
            last = [*last[-19:], line.rstrip()]
            if line.startswith(PROGRESS) and time.monotonic() - logged > LOG_EVERY_S:
                logged = time.monotonic()
                log.info(line.rstrip())
    finally:
        _end(process)
    if last and last[-1].startswith(PROGRESS):
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


def asked_for(context: Any, plan: Plan) -> bool:
    """False, with a warning that says what to do, in a run that makes the motions as well as this training."""
    made = context.run.asset_selection or context.job_def.asset_layer.executable_asset_keys
    if SHARED[0].key not in made:
        return True
    name = plan.key.to_user_string()
    context.log.warning(
        f"'{name}' is not trained, and what is made of it is skipped: this run materializes everything. To train, "
        f"materialize '{name}' alone, or start its job."
    )
    return False


def curves_of(folder: Path) -> dict[str, Any]:
    """A run's curves as a picture, and its last figures as numbers that plot over materializations."""
    from pipeline.viewing.tracking_plots import training_curves

    path = folder / "curves.csv"
    if not path.is_file():
        return {}
    table = pd.read_csv(path)
    last = table.iloc[-1]
    shown = ("task_reward", "style_reward", "d_expert", "d_policy", "episode_s", "steps_per_s")
    numbers = {name: float(last[name]) for name in shown if name in table and last[name] == last[name]}
    bins = [name.removesuffix("_commanded") for name in table if name.endswith("_commanded")]
    kinds = ("commanded", "achieved")
    speeds = [{"command": name, **{kind: last[f"{name}_{kind}"] for kind in kinds}} for name in bins]
    achieved = {"achieved against commanded velocity": table_of(speeds)} if bins else {}
    return {**numbers, "curves": picture(training_curves({"": table})), **achieved}


def validation_of(folder: Path) -> dict[str, Any]:
    """What validation found of a run's checkpoints and of the chosen policy; empty for a run that is not validated."""
    found = folder / "validation"
    if not (found / "figures.json").is_file():
        return {}
    sweep, figures = (json.loads((found / name).read_text()) for name in ("sweep.json", "figures.json"))
    swept = sweep["checkpoints"]
    measured = [{"figure": name, "value": value} for name, value in figures["figures"].items()]
    return {
        "verdict": figures["summary"],
        "checkpoint": f"iteration {sweep['iteration']}, the best of {len(swept)} on development trials",
        "sweep of checkpoints": table_of(swept),
        "figures": table_of(measured),
    }
