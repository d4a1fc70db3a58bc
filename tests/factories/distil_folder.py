"""What tests of `distil` ask: a bundle with two teachers, and the arguments of a small run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.learning.policy_file import write_policy
from pipeline.training.bundle import read_bundle
from pipeline.training.distil_request import BATCH
from tests.factories.training_bundle import small_bundle

ENVS = 8
APART = 0.5
"""By how much the teacher of who stands does something else, at every joint."""
HALF_STAND = ["standing_share=.5", "alone_shares=.1,.1,.1", "fast_share=.1", "quiet_share=.5", "quiet_pushed=0"]


def distil_folder(folder: Path, root: Path, robot) -> Path:
    """A bundle; the shipped policy with its robot's gains, and one that differs by its last bias."""
    facts = read_bundle(small_bundle(folder, root, robot)).robot
    with np.load(root / "robots/t1/policies/walk/policy.npz", allow_pickle=False) as arrays:
        shipped = {name: arrays[name] for name in arrays.files}
    shipped |= {name: getattr(facts, name) for name in ("kp", "kd", "default_joint_pos")}
    write_policy(folder / "walks.npz", shipped)
    write_policy(folder / "stands.npz", {**shipped, "L3_b": shipped["L3_b"] + np.float32(APART)})
    return folder


def asked(folder, out, *more: str) -> list[str]:
    """Arguments of a small run; what is named again in `more` counts."""
    few = ["--device", "cpu", "--num-envs", str(ENVS), "--memory", str(BATCH), "--passes", "60"]
    sets = [f"--set={text}" for text in HALF_STAND]
    teachers = ["--teacher", f"other={folder / 'walks.npz'}", "--teacher", f"standing={folder / 'stands.npz'}"]
    return ["--bundle", str(folder / "bundle"), "--out", str(out), *few, *sets, *teachers, *more]
