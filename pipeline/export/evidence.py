"""Additional figures of a card: other seeds of the recipe, and held-out trials."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pipeline.deployment import Policy, digest, gains_by_joint
from pipeline.export.card import HELD_OUT
from pipeline.export.metadata import BUNDLE, CONFIG, DONE, ExportError, read_json

FIGURES = "validation/figures.json"
"""Figures in the folder of a training run (`pipeline.training.validation_stage`)."""
RECIPE = ("commit", "preset", "options", "stages", "processes", BUNDLE)
"""Settings that are equal in all runs of a recipe."""
VALIDATE = "Write one: booster-lab validate POLICY --suite held-out --json FILE"


def other_seeds(run: Path, others: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """Figures and GPU time of validated runs that differ from `run` only in the seed, by seed.

    Raises FileError for a run without validation, ExportError for one of another recipe and for a seed named twice.
    """
    own = read_json(run / CONFIG)
    seeds, found = {own["seed"]}, {}
    for other in others:
        config = read_json(other / CONFIG)
        differs = [name for name in RECIPE if config.get(name) != own.get(name)]
        if differs:
            raise ExportError(
                f"{other}: differs from {run} in {', '.join(differs)}, so it is not another seed of the same recipe."
            )
        if config["seed"] in seeds:
            raise ExportError(f"{other}: seed {config['seed']} is given twice. Name each seed once.")
        seeds.add(config["seed"])
        measured = read_json(other / FIGURES, do="Validate it: repeat its command with the stage validation.")
        ended = read_json(other / DONE)
        facts = {"gpu_seconds": ended.get("gpu_seconds"), "summary": measured["summary"]}
        found[str(config["seed"])] = {**facts, "policy": measured["policy"], "figures": measured["figures"]}
    return found


def held_out(path: Path, policy: Policy) -> dict[str, Any]:
    """Number of required cells of the suite `held-out` that a policy passed, and the reasons for the others.

    Args:
        path: verdict, as `booster-lab validate --json` writes it
        policy: the policy

    Raises FileError for a file without a JSON object, ExportError for another suite's verdict, another policy's, or
    one with other gains.
    """
    verdict = read_json(path, do=VALIDATE)
    if verdict.get("suite") != HELD_OUT:
        raise ExportError(f"{path}: is not a verdict of the suite held-out. {VALIDATE}")
    if verdict.get("policy") != digest(policy):
        raise ExportError(f"{path}: is a verdict on another policy ({str(verdict.get('policy'))[:12]}). {VALIDATE}")
    own = policy.gains
    if own is None or verdict.get("gains") != gains_by_joint(own.joint_names, own.kp, own.kd):
        raise ExportError(f"{path}: is a verdict with other gains than those of the policy. {VALIDATE}")
    words = [cell["verdict"] for cell in verdict["cells"]]
    passed, failed = words.count("passed"), words.count("failed")
    return {"passed": passed, "required": passed + failed, "reasons": verdict["reasons"]}
