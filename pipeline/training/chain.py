"""The training chain: bundle -> distillation from the tracker -> AMP + PPO -> validation -> policy with its card.

<out>/config.json      command, commit, preset, every option, seed, device, digests of bundle and database, versions
<out>/distillation/    first stage (`stage.py` lists the files of a stage)
<out>/amp/             second stage
<out>/validation/      last stage (`validation_stage.py` lists its files)
<out>/policy.npz       the best network (without validation: the newest), readable by `pipeline.deployment.load_policy`
<out>/curves.csv       curves of the last training stage
<out>/export/          after validation: ONNX, deployment task and card (`pipeline.export`)
<out>/done.json        written last: iterations of the last training stage; steps, seconds, GPU seconds of all stages

A finished stage is not repeated; an interrupted one continues from its newest checkpoint. After training,
`config.json` no longer changes: it describes the machine that trained the policy, not the one that validated it.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from pipeline.learning.checkpoint import load_checkpoint, newest_checkpoint
from pipeline.learning.run_command import commit_of, device_name, started_module, versions, write_json
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import Bundle
from pipeline.training.config import changed_from, texts_of
from pipeline.training.distillation.run import DistillationStage
from pipeline.training.environment import chosen_physics
from pipeline.training.runner import AmpStage
from pipeline.training.stage import CHECKPOINTS, CURVES, DONE, POLICY, Request

if TYPE_CHECKING:
    from pipeline.training.validation_stage import ValidationStage

DISTILLATION, AMP, VALIDATION = "distillation", "amp", "validation"
STAGES = (DISTILLATION, AMP, VALIDATION)
CONFIG = "config.json"
SETTINGS = ("options", "seed", "bundle_digest", "stages")
"""Parts of `config.json` that must be equal to continue a run; until training is done, also the number of processes."""
LABELS = {"bundle_digest": "bundle", "stages": "choice of stages", "processes": "number of processes"}
"""Names of these parts in messages."""
VARIABLE_PARTS = ("commit", "device", "physics")
"""Parts that may change when a run continues; `config.json` lists all their values, as `NVIDIA H100, NVIDIA H200`."""
POLL_S = 1.0
"""Interval at which the other processes check whether rank 0 has finished distillation [s]."""


def stages_of(request: Request, requested: Sequence[str] | None) -> tuple[str, ...]:
    """Stages of a run: the requested ones; by default all, on a CPU all but AMP + PPO.

    Raises TrainingError if no stage would train, or if AMP + PPO would lack its distilled start.
    """
    selected = requested or (STAGES if request.device != "cpu" else (DISTILLATION, VALIDATION))
    if request.config.distillation.iterations == 0:
        selected = [name for name in selected if name != DISTILLATION]
    stages = tuple(name for name in STAGES if name in selected)
    if requested and not training_stages(requested):
        raise TrainingError("validation alone is not a run. Name all its stages: --stages distillation amp validation.")
    if not training_stages(stages):
        raise TrainingError(
            "no stage is left to train: distillation.iterations is 0, and AMP + PPO is not selected (on a CPU it must "
            "be named: --stages amp validation)."
        )
    if AMP in stages and DISTILLATION not in stages and request.config.distillation.iterations > 0:
        raise TrainingError(
            "AMP + PPO begins with the distilled network. Name that stage too, as --stages distillation amp, or train "
            "from scratch: --set distillation.iterations=0."
        )
    return stages


def training_stages(stages: Sequence[str]) -> list[str]:
    """The stages that train: all but validation."""
    return [name for name in stages if name != VALIDATION]


def train(bundle: Bundle, request: Request, stages: Sequence[str]) -> None:
    """Run the unfinished stages and write the policy.

    Raises TrainingError if `out` holds another run, the input of a stage was removed, or the bundle lacks data.
    """
    if DISTILLATION in stages and bundle.teacher is None:
        raise TrainingError(
            f"{bundle.folder}: the bundle has no tracker to distil from. Materialize augmented_motions and write the "
            "bundle again, or train from scratch: --set distillation.iterations=0."
        )
    longest, window = np.diff(bundle.expert.clip_start).max(), request.config.discriminator.frames
    if AMP in stages and longest < window:
        raise TrainingError(
            f"{bundle.folder}: its longest clip has {longest} frames, fewer than a window's discriminator.frames "
            f"({window}). Lower that option, or write the bundle again with longer clips."
        )
    is_main = int(os.getenv("RANK", "0")) == 0
    last = request.out / training_stages(stages)[-1]
    validation = _validation(bundle, request.out / VALIDATION, last) if VALIDATION in stages else None
    config = _config(bundle, request, stages)
    is_trained = all((request.out / name / DONE).is_file() for name in training_stages(stages))
    previous = _same_run(request.out, config, SETTINGS if is_trained else (*SETTINGS, "processes"))
    if is_main and not (is_trained and previous):
        joined = {name: _joined_values(previous.get(name, ""), config[name]) for name in VARIABLE_PARTS if previous}
        write_json(request.out / CONFIG, {**config, **joined})
    for name in training_stages(stages):
        folder = request.out / name
        if (folder / DONE).is_file():
            continue
        stale = [request.out / each for each in STAGES[STAGES.index(name) + 1 :] if (request.out / each).exists()]
        if is_main and stale:  # other ranks may see a folder that rank 0 has just created
            raise TrainingError(f"{folder}: is not done, but {stale[0]} was made from it. Remove {stale[0]} as well.")
        if name == DISTILLATION:
            if is_main:
                DistillationStage(bundle, request, folder).run()
            else:
                _wait_for(folder / DONE)
        else:
            AmpStage(bundle, request, folder, _distilled(request, stages)).run()
    if is_main:
        _finish(bundle, request, stages, validation)


def _validation(bundle: Bundle, folder: Path, last: Path) -> ValidationStage:
    """The validation stage, created before training. Raises TrainingError if anything it needs is missing."""
    try:  # a host that only trains has no packages besides mjlab and jaxtyping
        from pipeline.training.validation_stage import ValidationStage
    except ImportError as error:
        raise TrainingError(
            f"validation can't be loaded here ({error}). Install the project, or leave validation out (--stages "
            "distillation amp) and repeat the command with it where the project is installed."
        ) from error
    return ValidationStage(bundle, folder, last)


def _distilled(request: Request, stages: Sequence[str]) -> dict[str, torch.Tensor] | None:
    """Actor of the last distillation checkpoint; None without distillation."""
    if DISTILLATION not in stages:
        return None
    path = newest_checkpoint(request.out / DISTILLATION / CHECKPOINTS)
    if path is None:
        raise TrainingError(f"{request.out / DISTILLATION}: is done but has no checkpoint. Remove the folder.")
    return load_checkpoint(path, request.device)["actor_state_dict"]


def _wait_for(path: Path) -> None:
    """Wait for rank 0, which distils on one GPU; if it dies, torchrun ends this process."""
    while not path.is_file():
        time.sleep(POLL_S)


def _finish(bundle: Bundle, request: Request, stages: Sequence[str], validation: ValidationStage | None) -> None:
    """Validate, and write policy, curves, card and durations to the run's folder."""
    last = request.out / training_stages(stages)[-1]
    if validation is not None and not (validation.folder / DONE).is_file():
        validation.run()
    for name, folder in ((CURVES, last), (POLICY, last if validation is None else validation.folder)):
        part = request.out / f"{name}.part"
        try:
            shutil.copyfile(folder / name, part)
            part.replace(request.out / name)
        except OSError as error:
            problem = f"could not be copied from {folder / name} ({error.strerror or error})."
            raise TrainingError(f"{request.out / name}: {problem}") from error
    each = {name: json.loads((request.out / name / DONE).read_text()) for name in stages}
    training = [each[name] for name in training_stages(stages)]
    sums = {key: sum(done[key] for done in training) for key in ("seconds", "steps", "gpu_seconds")}
    done = {**training[-1], **sums, "steps_per_s": sums["steps"] / max(sums["seconds"], 1e-9), "stages": each}
    if validation is not None:
        from pipeline.export.card import OF_RUN
        from pipeline.export.folder import export_policy, source_of_run
        from pipeline.robot import load_robot

        source = source_of_run(request.out, stated=done)
        robot, rng = load_robot(bundle.robot_folder), np.random.default_rng(0)
        export_policy(request.out / OF_RUN, request.out.name, robot, source, rng, shippable=False)
    write_json(request.out / DONE, done)


def _joined_values(earlier: str, now: str) -> str:
    """The distinct values over all continuations of a run, separated by commas."""
    return ", ".join(dict.fromkeys(value or "not stated" for value in (*earlier.split(", "), now)))


def _same_run(out: Path, config: dict[str, Any], settings: Sequence[str]) -> dict[str, Any]:
    """The folder's `config.json`, empty if absent. Raises TrainingError if it has other settings."""
    path = out / CONFIG
    if not path.is_file():
        return {}
    try:
        previous = json.loads(path.read_text())
    except ValueError as error:
        raise TrainingError(f"{path}: is not JSON ({error}). Give another --out.") from error
    if not isinstance(previous, dict) or not isinstance(previous.get("options", {}), dict):
        raise TrainingError(f"{path}: is not the config of a training run. Give another --out.")
    current = json.loads(json.dumps(config))
    at, differs = "", [name for name in settings if previous.get(name) != current[name]]
    if "options" in differs:
        before, now = previous.get("options") or {}, current["options"]
        changed = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        differs = [name for name in differs if name != "options"] + changed
        at = "" if set(before) == set(now) else f" at commit {previous.get('commit', 'unknown')}"
    if differs:
        shown = ", ".join(f"another {LABELS.get(name, name)}" for name in differs)
        raise TrainingError(f"{out}: belongs to a run with {shown}. Repeat its own command{at}, or give another --out.")
    return previous


def command_of(bundle: Bundle, request: Request, stages: Sequence[str]) -> str:
    """The command that repeats the run, with paths relative to the working folder where possible."""
    arguments = {
        "bundle": _relative(bundle.folder),
        "out": _relative(request.out),
        "preset": request.preset,
        "device": request.device.split(":")[0],
        "physics": request.physics,
        "seed": request.seed,
    }
    words = ["python", *started_module("pipeline.training", int(os.getenv("WORLD_SIZE", "1")))]
    words += [text for name, value in arguments.items() if value is not None for text in (f"--{name}", str(value))]
    words += [text for each in texts_of(changed_from(request.preset, request.config)) for text in ("--set", each)]
    return shlex.join([*words, "--stages", *stages])


def _relative(path: Path) -> Path:
    path = path.resolve()
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _config(bundle: Bundle, request: Request, stages: Sequence[str]) -> dict[str, Any]:
    return {
        "command": command_of(bundle, request, stages),
        "commit": commit_of(Path(__file__).parent),
        "preset": request.preset,
        "options": request.config.values(),
        "changed": changed_from(request.preset, request.config),
        "seed": request.seed,
        "stages": training_stages(stages),
        "num_envs": request.config.simulation.num_envs,
        "processes": int(os.getenv("WORLD_SIZE", "1")),
        "device": device_name(request.device),
        "physics": chosen_physics(request.device, request.physics),
        "bundle_digest": bundle.digest,
        "bundle": bundle.about,
        "versions": versions(),
    }
