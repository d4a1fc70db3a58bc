"""Run folders of an ablation as training leaves them, written without training."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.training.config import changed_from, preset

ARMS = {"augmented": True, "original": False}
CURVES = "iteration,seconds,d_rollout\n1,1.5,-0.5\n2,3.0,-0.25\n"


def write_arm_run(folder: Path, bundle: Path, *, arm: str = "augmented", seed: int = 1, **options: Any) -> Path:
    """A run of an arm that was trained on a bundle (its `bundle.json`), with `policy.npz` that tells its name."""
    run = folder / f"{arm}-seed{seed}"
    run.mkdir(parents=True)
    values = {name.replace("__", "."): value for name, value in options.items()}
    chosen = preset("paper").changed({"discriminator.use_augmented": ARMS[arm], **values})
    data = (bundle / "bundle.json").read_bytes()
    config = {
        "preset": "paper",
        "options": chosen.values(),
        "changed": changed_from("paper", chosen),
        "seed": seed,
        "num_envs": 4096,
        "processes": 1,
        "device": "NVIDIA H100 80GB HBM3",
        "physics": "warp",
        "bundle_digest": hashlib.sha256(data).hexdigest(),
        "bundle": json.loads(data),
        "versions": {"torch": "2.11.0"},
    }
    (run / "config.json").write_text(json.dumps(config))
    (run / "curves.csv").write_text(CURVES)
    (run / "done.json").write_text(json.dumps({"iterations": 2, "reason": "minutes", "seconds": 3.0}))
    (run / "policy.npz").write_bytes(run.name.encode())
    return run


def write_arm_runs(folder: Path, bundle: Path, seeds: tuple[int, ...] = (1,), **options: Any) -> Path:
    """Both arms with every seed; the folder."""
    for seed in seeds:
        for arm in ARMS:
            write_arm_run(folder, bundle, arm=arm, seed=seed, **options)
    return folder


def change_config(run: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Write the config of a run anew, changed in place."""
    config = json.loads((run / "config.json").read_text())
    change(config)
    (run / "config.json").write_text(json.dumps(config))
