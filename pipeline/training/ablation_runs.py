"""Runs of an ablation that were trained elsewhere: read, and compared with each other and with the bundle here.

Below one folder: `<arm>-seed<N>/` is the folder of a run as `python -m pipeline.training` writes it.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.learning.training_error import TrainingError
from pipeline.training.config import texts_of

CONFIG, CURVES, DONE, POLICY = "config.json", "curves.csv", "done.json", "policy.npz"
OPTION = "discriminator.use_augmented"
"""The one option in which arms differ."""
KEYS = ("preset", "options", "changed", "seed", "num_envs", "device", "bundle_digest", "bundle")
"""What a run's config must say."""
COLUMNS = ("seconds", "d_rollout")
"""Columns of `curves.csv` that the picture of the discriminator's score is drawn from."""
MACHINE = ("device", "versions")
"""Keys of a config in which other seeds may differ; arms of one seed may not."""
DIGESTS = {"database_digest": "expert database", "robot_digest": "robot"}


@dataclass(frozen=True, kw_only=True)
class ArmRun:
    """One run of an arm that is done."""

    folder: Path
    arm: str
    seed: int
    config: dict[str, Any]
    """What `config.json` says."""
    done: dict[str, Any]
    """What `done.json` says."""

    @property
    def name(self) -> str:
        """`<arm>-seed<N>`."""
        return self.folder.name

    @property
    def options(self) -> list[str]:
        """Options that both arms have other than the preset, as `name=value`."""
        return texts_of({name: value for name, value in self.config["changed"].items() if name != OPTION})

    def command(self, bundle: Path) -> str:
        """The command that makes the run again from `bundle`."""
        config = self.config
        count = config.get("processes", 1)
        module = f"-m torch.distributed.run --standalone --nproc-per-node={count} " if count > 1 else ""
        given = {
            "bundle": bundle.as_posix(),
            "out": self.name,
            "preset": config["preset"],
            "device": "cpu" if config["device"] == "cpu" else "cuda",
            "physics": config.get("physics"),
            "seed": self.seed,
        }
        texts = [f"--{name} {value}" for name, value in given.items() if value is not None]
        texts += [f"--set {text}" for text in texts_of(config["changed"])]
        return f"python {module}-m pipeline.training {' '.join(texts)}"


def read_runs(folder: Path, arms: Mapping[str, bool], bundle: Path) -> tuple[ArmRun, ...]:
    """The runs in a folder, seed by seed, in the order of the arms.

    `folder` has a folder `<arm>-seed<N>` for each run, `arms` the value of `use_augmented` of each arm.

    Raises TrainingError for runs that are not whole, are of another bundle, or whose arms differ in more than their one
    option; the message lists every fault.
    """
    if not folder.is_dir():
        raise TrainingError(f"{folder}: there is no such folder. Name the one that has the runs' folders.")
    folders = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
    pattern = re.compile(rf"({'|'.join(arms)})-seed(0|[1-9]\d*)")
    named = {path: pattern.fullmatch(path.name) for path in folders}
    form = f"{folder.name}/<arm>-seed<N>, the arm {' or '.join(arms)}"
    _refuse([f"{path}: is no run's folder. Name it {form}, or take it away." for path in folders if not named[path]])
    seeds = {arm: {int(found[2]) for found in named.values() if found and found[1] == arm} for arm in arms}
    alike = set.intersection(*seeds.values())
    if not folders or any(found != alike for found in seeds.values()):
        listed = "; ".join(f"{arm} {', '.join(map(str, sorted(found))) or 'none'}" for arm, found in seeds.items())
        raise TrainingError(f"{folder}: the arms' seeds are {listed}. Each arm needs the same: {form}.")
    _refuse([fault for path in folders for fault in _file_faults(path)])
    found = [_read_run(folder / f"{arm}-seed{seed}", arm, seed) for seed in sorted(alike) for arm in arms]
    _refuse([fault for run in found for fault in _run_faults(run, arms[run.arm], bundle)])
    _refuse([fault for run in found for fault in _pair_faults(run, found)])
    return tuple(found)


def _refuse(faults: list[str]) -> None:
    """Raises TrainingError with all faults, a line each, where there are any."""
    if faults:
        raise TrainingError("\n".join(faults))


def _file_faults(folder: Path) -> Iterator[str]:
    """Files that are missing."""
    for name in (CONFIG, CURVES, POLICY):
        if not (folder / name).is_file():
            yield f"{folder / name}: there is no such file. Bring the whole folder of the run back."
    if not (folder / DONE).is_file():
        yield f"{folder / DONE}: there is none, so the run is not finished. Repeat its command until it is done."


def _read_run(folder: Path, arm: str, seed: int) -> ArmRun:
    """A run's files. Raises TrainingError where one is no JSON or says too little."""
    config, done = _json(folder / CONFIG), _json(folder / DONE)
    missing = [key for key in KEYS if key not in config]
    missing += [key for key in ("options", "changed", "bundle") if not isinstance(config.get(key, {}), dict)]
    if missing:
        raise TrainingError(
            f"{folder / CONFIG}: does not say {', '.join(missing)}. Take what python -m pipeline.training wrote."
        )
    return ArmRun(folder=folder, arm=arm, seed=seed, config=config, done=done)


def _json(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text())
    except ValueError as error:
        raise TrainingError(f"{path}: is no JSON ({error}). Bring the file back again.") from error
    if not isinstance(value, dict):
        raise TrainingError(f"{path}: is no JSON object. Bring the file back again.")
    return value


def _run_faults(run: ArmRun, augmented: bool, bundle: Path) -> Iterator[str]:
    """What is wrong with a run by itself."""
    path, config = run.folder / CONFIG, run.config
    options, changed = config["options"], config["changed"]
    if config["seed"] != run.seed:
        yield f"{path}: the seed is {config['seed']}, the folder's name says {run.seed}. Name the folder by its seed."
    if options.get(OPTION) is not augmented:
        yield (
            f"{path}: option '{OPTION}' is {json.dumps(options.get(OPTION))}, arm '{run.arm}' has "
            f"{json.dumps(augmented)}. Name the folder by its arm, or train it with --set {OPTION}="
            f"{json.dumps(augmented)}."
        )
    wrong = [name for name, value in changed.items() if name not in options or options[name] != value]
    if wrong:
        yield f"{path}: 'changed' and 'options' disagree on {', '.join(wrong)}. Bring the file back again."
    yield from _bundle_faults(path, config, bundle)
    yield from _curve_faults(run.folder / CURVES)


def _bundle_faults(path: Path, config: dict[str, Any], bundle: Path) -> Iterator[str]:
    """Whether it was trained on what the project has now."""
    data = (bundle / "bundle.json").read_bytes()
    here, trained_on = json.loads(data), config["bundle"]
    other = [words for key, words in DIGESTS.items() if trained_on.get(key) != here.get(key)]
    if config["bundle_digest"] != hashlib.sha256(data).hexdigest():
        other = other or ["bundle (its files)"]
    if other:
        yield (
            f"{path}: was trained on another {' and another '.join(other)} than the bundle in {bundle}. Train on that "
            "bundle, or check out and materialize what it was trained on."
        )


def _curve_faults(path: Path) -> Iterator[str]:
    """Whether the discriminator's score can be drawn."""
    rows = list(csv.DictReader(path.read_text().splitlines()))
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        yield f"{path}: has no rows with {', '.join(missing)}. Bring the file back again."
    elif not all(any(_finite(row[name]) for row in rows) for name in COLUMNS):
        yield f"{path}: has no number in {' or '.join(COLUMNS)}. Train with discriminator.style above 0."


def _finite(text: str | None) -> bool:
    try:
        return math.isfinite(float(text or "nan"))
    except ValueError:
        return False


def _pair_faults(run: ArmRun, runs: list[ArmRun]) -> Iterator[str]:
    """In what the run differs from the first of its seed, or, being that, from the very first, and may not."""
    first = next(each for each in runs if each.seed == run.seed)
    left_out: tuple[str, ...] = ()
    if run is first:
        first, left_out = runs[0], MACHINE
    one, other = (_settings(each.config, left_out) for each in (first, run))
    names = [name for name in sorted(one.keys() | other.keys()) if one.get(name) != other.get(name)]
    if names:
        values = "; ".join(f"{name}: {one.get(name)} there, {other.get(name)} here" for name in names)
        yield (
            f"{run.folder / CONFIG}: differs from {first.name} in more than '{OPTION}' ({values}). Train all with the "
            "same settings."
        )


def _settings(config: dict[str, Any], left_out: tuple[str, ...]) -> dict[str, Any]:
    """All of a config, flat, but for its seed and what follows from the arm."""
    left_out = ("command", "seed", "options", "changed", *left_out)
    kept = {name: value for name, value in config.items() if name not in left_out}
    for part in ("options", "changed"):
        kept |= {f"{part}.{name}": value for name, value in config[part].items() if name != OPTION}
    return kept
