"""Training runs in separate processes: one at a time per machine; a repeated request continues the run.

The button `Materialize all` of the web UI materializes all other assets and trains nothing (`is_requested`).
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
"""Prefixes of progress lines."""
LOG_EVERY_S = 10.0
"""Minimum interval between progress lines in the log [s]."""
TRIAL_ENVS, TRIAL_ITERATIONS = 8, 2
"""Size of a trial without a GPU: sufficient to show that training runs."""


class TrainingFailedError(PipelineError):
    """The training process ended with an error; its last lines are quoted."""


class TrainingConfig(dg.Config):
    """Options of a training, and its device."""

    preset: str = DEFAULT
    """`recipe` or `paper` (pipeline/training/config.py)."""
    options: list[str] = []  # noqa: RUF012, a field
    """Options that differ from the preset, as `group.name=value`."""
    seed: int = 1
    device: str = "auto"
    """`cuda`, `cpu` (a trial of two iterations), or `auto`: the GPU if there is one."""
    gpus: int = 1
    """Number of processes, one per GPU."""
    num_envs: int = 0
    """Number of environments per process; 0: as in the preset, or 8 in a trial."""
    iterations: int = 0
    """Number of AMP + PPO iterations, in a trial also of distillation; 0: as in the preset, or 2 in a trial."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """A training run, which a separate process executes."""

    folder: Path
    bundle: Path
    device: str
    command: tuple[str, ...]
    """Arguments of the Python interpreter."""

    @property
    def trial(self) -> bool:
        """Whether it is a trial: a few iterations on the CPU that give no usable policy."""
        return self.device == "cpu"

    @property
    def done(self) -> bool:
        """Whether it ended without being interrupted."""
        return (self.folder / "done.json").is_file()


def run_in(folder: Path, bundle: Path, module: str, gpus: int, *more: str, **options: Any) -> Run:
    """The run that starts a module.

    Args:
        folder: folder of its output
        bundle: folder of its training bundle
        module: module to start
        gpus: number of GPUs, with one process each
        more: further arguments, appended unchanged
        options: options, of which `device` is required; `device="cpu"` becomes `--device cpu`
    """
    given = {"bundle": bundle, "out": folder, **options}
    words = [text for name, value in given.items() for text in (f"--{name.replace('_', '-')}", str(value))]
    command = (*started_module(module, gpus), *words, *more)
    return Run(folder=folder, bundle=bundle, device=options["device"], command=command)


STAGES = ("distillation", "amp")
"""Stages of a trial. By default, a training on the CPU only runs distillation."""


def run_of(config: TrainingConfig, runs: Path, bundle: Path, bundle_digest: str, options: Sequence[str] = ()) -> Run:
    """The run for a config on this machine. Equal requests have the same folder, in which the run continues.

    A request includes the values of the preset, so that a changed preset starts a new run. Raises TrainingFailedError
    if there are fewer GPUs than requested, TrainingError for an unknown preset.

    Args:
        config: config of the asset
        runs: folder of all runs
        bundle: folder of the training bundle
        bundle_digest: digest of the bundle's content
        options: further options, as `group.name=value`
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
    request: dict[str, Any] = {
        "preset": config.preset,
        "options": [*texts, *options, *config.options],
        "seed": config.seed,
        "device": device,
        "gpus": 1 if trial else config.gpus,
        "trial": trial,
    }
    name = digest.of_json([bundle_digest, values, request])[:10]
    folder = runs / f"{'trial-' if trial else ''}{config.preset}-seed{config.seed}-{name}"
    more = [text for each in request["options"] for text in ("--set", each)] + (["--stages", *STAGES] if trial else [])
    given = {name: request[name] for name in ("device", "seed", "preset")}
    return run_in(folder, bundle, "pipeline.training", request["gpus"], *more, **given)


def device_of(requested: str, gpus: int) -> str:
    """`cuda` or `cpu`; for `auto` the GPU if there is one. Raises TrainingFailedError for too many GPUs."""
    available = gpus_here()
    device = requested if requested != "auto" else "cuda" if available else "cpu"
    if device == "cuda" and available < gpus:
        raise TrainingFailedError(
            f"{gpus} GPUs are requested, {available} are available. Request fewer, or set the device to 'auto', which "
            "runs a trial if there is no GPU."
        )
    return device


def gpus_here() -> int:
    """Number of GPUs that PyTorch finds."""
    import torch

    return torch.cuda.device_count() if torch.cuda.is_available() else 0


def train(run: Run, root: Path, lock: Path, log: Any) -> None:
    """Train until the run is done; return at once if it already is. Raises TrainingFailedError.

    Args:
        run: the run
        root: working directory of the process
        lock: lock file that all trainings of the project share
        log: log of the Dagster run
    """
    if run.done:
        log.info(f"{run.folder.name} is already done: nothing is trained")
        trained, now = stated_commit(run.folder), commit_of(Path(__file__).parent)
        if now not in trained:
            log.warning(
                f"it was trained at commit {trained}, the code is at {now}. To train again, remove {run.folder}"
            )
        return
    run.folder.mkdir(parents=True, exist_ok=True)
    with _alone(lock, log) as held:
        log.info(f"training in a separate process: python {' '.join(run.command)}")
        _follow([sys.executable, *run.command], root, held, log)
    if not run.done:
        raise TrainingFailedError(f"{run.folder}: training ended without done.json. Materialize again to continue it.")


def stated_commit(folder: Path) -> str:
    """Commits in the `config.json` of a run; empty if it has none."""
    path = folder / "config.json"
    return str(json.loads(path.read_text()).get("commit", "")) if path.is_file() else ""


def _follow(command: list[str], root: Path, held: IO[str], log: Any) -> None:
    """Run a command to its end and log its progress. It inherits the lock, which it holds as long as it lives."""
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
    """Wait for the process. If an exception stops this process, terminate that one and its children first."""
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
    """Hold the lock that allows one training at a time. The system releases it when the last process with it ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            log.info("waiting for another training to end")
            fcntl.flock(stream, fcntl.LOCK_EX)
        yield stream


def is_requested(context: Any, plan: Plan) -> bool:
    """Whether a run requests this training. A run that also materializes the motions does not: it logs a warning."""
    made = context.run.asset_selection or context.job_def.asset_layer.executable_asset_keys
    if SHARED[0].key not in made:
        return True
    name = plan.key.to_user_string()
    context.log.warning(
        f"'{name}' is not trained, and assets that need it are skipped, because this run materializes all assets. To "
        f"train, materialize only '{name}', or start its job."
    )
    return False


def curves_of(folder: Path) -> dict[str, Any]:
    """Metadata of a run: its training curves as a picture, and their last values, which the web UI plots over runs."""
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
    achieved = {"commanded and achieved velocity": table_of(speeds)} if bins else {}
    return {**numbers, "curves": picture(training_curves({"": table})), **achieved}


def validation_of(folder: Path) -> dict[str, Any]:
    """Metadata of the validation of a run's checkpoints and selected policy; empty if it was not validated."""
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
