"""The training chain: bundle -> distillation from the tracker -> AMP + PPO -> validation -> policy with its card.

<out>/config.json      command, commit, preset, every option, seed, device, digests of bundle and database, versions
<out>/distillation/    the first stage (`stage.py` lists the files of a stage)
<out>/amp/             the second one
<out>/validation/      the last one (`validation_stage.py` lists its files)
<out>/policy.npz       the chosen network, without validation the newest, as `pipeline.deployment.load_policy` reads it
<out>/curves.csv       curves of the last training stage
<out>/export/          after validation: ONNX, deployment task and card (`pipeline.export`)
<out>/done.json        written last: iterations of the last training stage; steps, seconds, GPU seconds of all of them

A stage that is done is not repeated; one that was interrupted continues from its newest checkpoint. Once all training
is done, `config.json` stays as it is: it says where the policy was trained, not where it was validated.
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
"""Parts of `config.json` that must be equal for a run to continue; until it is trained, its number of processes too."""
NAMED = {"bundle_digest": "bundle", "stages": "choice of stages", "processes": "number of processes"}
"""Names of some of them in messages."""
PLACES = ("commit", "device", "physics")
"""Parts that may differ when a run continues; `config.json` has all their values, as `NVIDIA H100, NVIDIA H200`."""
POLL_S = 1.0
"""How often other processes look whether the first one has distilled [s]."""


def stages_of(request: Request, asked: Sequence[str] | None) -> tuple[str, ...]:
    """The stages of a run: those that are asked for; otherwise all, and on a CPU all but AMP + PPO.

    Raises TrainingError where nothing is left to train, or AMP + PPO would lack its distilled start.
    """
    taken = asked or (STAGES if request.device != "cpu" else (DISTILLATION, VALIDATION))
    if request.config.distillation.iterations == 0:
        taken = [name for name in taken if name != DISTILLATION]
    stages = tuple(name for name in STAGES if name in taken)
    if asked and not trained(asked):
        raise TrainingError("validation alone makes no run. Name all its stages: --stages distillation amp validation.")
    if not trained(stages):
        raise TrainingError(
            "nothing is left to train: distillation.iterations is 0, and AMP + PPO is not among the stages (on a CPU "
            "it must be named: --stages amp validation)."
        )
    if AMP in stages and DISTILLATION not in stages and request.config.distillation.iterations > 0:
        raise TrainingError(
            "AMP + PPO begins with the distilled network. Name that stage too, as --stages distillation amp, or train "
            "from scratch: --set distillation.iterations=0."
        )
    return stages


def trained(stages: Sequence[str]) -> list[str]:
    """The stages that train."""
    return [name for name in stages if name != VALIDATION]


def train(bundle: Bundle, request: Request, stages: Sequence[str]) -> None:
    """Run the stages that are not done yet, and write the policy.

    Raises TrainingError for a folder of another run or of a stage whose input was removed, or an unfit bundle.
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
    first = int(os.getenv("RANK", "0")) == 0
    last = request.out / trained(stages)[-1]
    validation = _validation(bundle, request.out / VALIDATION, last) if VALIDATION in stages else None
    config = _config(bundle, request, stages)
    is_trained = all((request.out / name / DONE).is_file() for name in trained(stages))
    known = _same_run(request.out, config, SETTINGS if is_trained else (*SETTINGS, "processes"))
    if first and not (is_trained and known):
        places = {name: _all_of(known.get(name, ""), config[name]) for name in PLACES if known}
        write_json(request.out / CONFIG, {**config, **places})
    for name in trained(stages):
        folder = request.out / name
        if (folder / DONE).is_file():
            continue
        stale = [request.out / each for each in STAGES[STAGES.index(name) + 1 :] if (request.out / each).exists()]
        if first and stale:  # other processes may see what the first one has begun meanwhile
            raise TrainingError(f"{folder}: is not done, but {stale[0]} was made from it. Remove {stale[0]} as well.")
        if name == DISTILLATION:
            if first:
                DistillationStage(bundle, request, folder).run()
            else:
                _wait_for(folder / DONE)
        else:
            AmpStage(bundle, request, folder, _distilled(request, stages)).run()
    if first:
        _finish(bundle, request, stages, validation)


def _validation(bundle: Bundle, folder: Path, last: Path) -> ValidationStage:
    """The last stage. Raises TrainingError where something that it needs is missing, so that it shows at the start."""
    try:  # a host that trains alone has mjlab, jaxtyping and no others
        from pipeline.training.validation_stage import ValidationStage
    except ImportError as error:
        raise TrainingError(
            f"validation can't be loaded here ({error}). Install the project, or leave validation out (--stages "
            "distillation amp) and repeat the command with it where the project is installed."
        ) from error
    return ValidationStage(bundle, folder, last)


def _distilled(request: Request, stages: Sequence[str]) -> dict[str, torch.Tensor] | None:
    """The actor that the distillation ended with."""
    if DISTILLATION not in stages:
        return None
    path = newest_checkpoint(request.out / DISTILLATION / CHECKPOINTS)
    if path is None:
        raise TrainingError(f"{request.out / DISTILLATION}: is done but has no checkpoint. Remove the folder.")
    return load_checkpoint(path, request.device)["actor_state_dict"]


def _wait_for(path: Path) -> None:
    """Wait for the first process, which distils on one GPU; torchrun ends this one if that one dies."""
    while not path.is_file():
        time.sleep(POLL_S)


def _finish(bundle: Bundle, request: Request, stages: Sequence[str], validation: ValidationStage | None) -> None:
    """Validate, and put the policy, its curves, its card and its times into the run's folder."""
    last = request.out / trained(stages)[-1]
    if validation is not None and not (validation.folder / DONE).is_file():
        validation.run()
    for name, folder in ((CURVES, last), (POLICY, last if validation is None else validation.folder)):
        part = request.out / f"{name}.part"
        try:
            shutil.copyfile(folder / name, part)
            part.replace(request.out / name)
        except OSError as error:
            problem = f"could not be made of {folder / name} ({error.strerror or error})."
            raise TrainingError(f"{request.out / name}: {problem}") from error
    each = {name: json.loads((request.out / name / DONE).read_text()) for name in stages}
    training = [each[name] for name in trained(stages)]
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


def _all_of(earlier: str, now: str) -> str:
    """The different values of a run's processes, separated by commas."""
    return ", ".join(dict.fromkeys(value or "not stated" for value in (*earlier.split(", "), now)))


def _same_run(out: Path, config: dict[str, Any], settings: Sequence[str]) -> dict[str, Any]:
    """The folder's `config.json`; empty where there is none. Raises TrainingError for a run with other settings."""
    path = out / CONFIG
    if not path.is_file():
        return {}
    try:
        known = json.loads(path.read_text())
    except ValueError as error:
        raise TrainingError(f"{path}: is not JSON ({error}). Give another --out.") from error
    if not isinstance(known, dict) or not isinstance(known.get("options", {}), dict):
        raise TrainingError(f"{path}: is of no training run. Give another --out.")
    asked = json.loads(json.dumps(config))
    at, differs = "", [name for name in settings if known.get(name) != asked[name]]
    if "options" in differs:
        before, now = known.get("options") or {}, asked["options"]
        changed = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        differs = [name for name in differs if name != "options"] + changed
        at = "" if set(before) == set(now) else f" at commit {known.get('commit', 'unknown')}"
    if differs:
        shown = ", ".join(f"another {NAMED.get(name, name)}" for name in differs)
        raise TrainingError(f"{out}: is of a run with {shown}. Repeat its own command{at}, or give another --out.")
    return known


def command_of(bundle: Bundle, request: Request, stages: Sequence[str]) -> str:
    """The command that makes the run again, its paths from the working folder where they lie in it."""
    given = {
        "bundle": _near(bundle.folder),
        "out": _near(request.out),
        "preset": request.preset,
        "device": request.device.split(":")[0],
        "physics": request.physics,
        "seed": request.seed,
    }
    words = ["python", *started_module("pipeline.training", int(os.getenv("WORLD_SIZE", "1")))]
    words += [text for name, value in given.items() if value is not None for text in (f"--{name}", str(value))]
    words += [text for each in texts_of(changed_from(request.preset, request.config)) for text in ("--set", each)]
    return shlex.join([*words, "--stages", *stages])


def _near(path: Path) -> Path:
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
        "stages": trained(stages),
        "num_envs": request.config.simulation.num_envs,
        "processes": int(os.getenv("WORLD_SIZE", "1")),
        "device": device_name(request.device),
        "physics": chosen_physics(request.device, request.physics),
        "bundle_digest": bundle.digest,
        "bundle": bundle.about,
        "versions": versions(),
    }
