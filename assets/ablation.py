"""`augmentation_ablation`: two policies on one database, with and without augmented clips, same seeds and settings."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import dagster as dg
import pandas as pd

from assets.actuators import declared
from assets.amp_policy import bundle_of, commit_of, run_facts, train_beside_others
from assets.plainly import plainly
from assets.plan import Plan
from assets.policy import NoPolicyError, result_of
from assets.project import DEFAULT_ROBOT, PROJECT, Project
from assets.report import picture, table_of
from assets.resources import ClipPoolResource
from assets.training_process import TrainingConfig, gpus_here, run_of
from pipeline.batch import Manifest
from pipeline.files import atomic, digest

ARMS = {"augmented": "use_augmented=true", "original": "use_augmented=false"}
"""Arm -> the one option in which its training differs."""
FILE, SCHEMA = "ablation.json", "booster-lab augmentation ablation 1"
RECORDED = "augmentation_ablation"
"""Folder below the policies that ship where recorded curves lie."""


class AblationConfig(TrainingConfig):
    """What both arms are trained with."""

    seeds: list[int] = [1]  # noqa: RUF012, a field


def augmentation_ablation(plan: Plan, database: Plan, adapted: Plan) -> Any:
    """The asset `augmentation_ablation` of a robot."""

    @dg.asset(**declared(plan, "pytorch", deps=[database.key, adapted.key]))
    @plainly
    def augmentation_ablation(context: dg.AssetExecutionContext, config: AblationConfig, clip_pool: ClipPoolResource):
        """The discriminator's score on policy samples, command and push figures with and without augmented clips."""
        robot = plan.robot or DEFAULT_ROBOT
        if config.device == "auto" and not gpus_here():
            folder = PROJECT.shipped_policies(robot) / RECORDED
            context.log.info(f"no GPU is here: the recorded curves of {folder.relative_to(PROJECT.root)} are served")
        else:
            folder = train_arms(config, robot, clip_pool, context.log)
        found = read_ablation(PROJECT, folder)
        origin = "recorded, ships with the project" if PROJECT.shipped_policies(robot) in folder.parents else "run here"
        facts = {**found, "stage": plan.name, "origin": origin, "folder": folder.relative_to(PROJECT.root).as_posix()}
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={RECORDED: facts})
        return result_of(plan, manifest, ablation_metadata(folder, facts), [])

    return augmentation_ablation


def train_arms(config: AblationConfig, robot: str, pool: ClipPoolResource, log: Any) -> Path:
    """Train every arm with every seed, one after the other, and write what came of it; its folder."""
    bundle, about = bundle_of(PROJECT, robot)
    folder = PROJECT.policies(robot) / RECORDED
    runs, commit = [], commit_of(PROJECT)
    for seed in config.seeds:
        for arm, option in ARMS.items():
            asked = config.model_copy(update={"seed": seed})
            run = run_of(asked, PROJECT.policy_runs(robot), bundle, digest.of_json(about), options=(option,))
            train_beside_others(run, PROJECT, robot, log)
            name = f"{arm}-seed{seed}"
            atomic.write_bytes(folder / f"{name}.csv", (run.folder / "curves.csv").read_bytes())
            facts = run_facts(run, robot, commit)
            figures = {} if run.trial else figures_of(run.folder / "policy.npz", robot, pool)
            runs.append({"name": name, "arm": arm, "seed": seed, "run": facts, "figures": figures})
    value = {
        "schema": SCHEMA,
        "label": label_of(about["augmented_by"]),
        "preset": config.preset,
        "options": config.options,
        "database": about["database_digest"],
        "trial": any(each["run"]["trial"] for each in runs),
        "runs": runs,
        "files": {f"{each['name']}.csv": digest.of_file(folder / f"{each['name']}.csv") for each in runs},
    }
    atomic.write_text(folder / FILE, json.dumps(value, indent=1, sort_keys=True) + "\n")
    return folder


def label_of(ways: Sequence[str]) -> str:
    """What the augmented arm has, "mirror and time-scale only": that nothing was tracked is not left to be guessed."""
    return " and ".join(filter(None, [", ".join(ways[:-1]), *ways[-1:]])) + " only" if ways else "no augmented clips"


def figures_of(policy: Path, robot: str, pool: ClipPoolResource) -> dict[str, float]:
    """Command and push figures of a policy in the sweep without noise in plain MuJoCo."""
    from pipeline.deployment import load_policy
    from pipeline.validation.checkpoint_choice import error_of
    from pipeline.validation.deployed import deployed
    from pipeline.validation.measure import measure
    from pipeline.validation.sweep import sweep_cells

    one = deployed(PROJECT.adapted_robot(robot), load_policy(policy))
    figures = {}
    for row in measure(one, sweep_cells(one.robot), pool.pool()):
        if row.cell.group == "commands":
            figures[f"error of {row.cell.name}"] = error_of(row)
        elif row.cell.group.startswith("pushes"):
            figures[f"survival of {row.cell.name}"] = 1.0 - len(row.fallen) / len(row.trials)
        else:
            figures[f"falls in {row.cell.name}"] = float(len(row.fallen))
    return figures


def read_ablation(project: Project, folder: Path) -> dict[str, Any]:
    """What was recorded in a folder, with all of its curves. Raises NoPolicyError where that is not there."""
    path, near = folder / FILE, folder.relative_to(project.root)
    if not path.is_file():
        raise NoPolicyError(
            f"there is no GPU here, and {near} has no recorded ablation. Run it on a machine with a GPU."
        )
    found = json.loads(path.read_text())
    if found.get("schema") != SCHEMA:
        raise NoPolicyError(f"{near / FILE}: is not of the schema {SCHEMA!r}. Run the ablation again.")
    wrong = [
        name
        for name, content in found["files"].items()
        if not (folder / name).is_file() or digest.of_file(folder / name) != content
    ]
    if wrong:
        raise NoPolicyError(f"{near}: {', '.join(wrong)} missing or changed. Run the ablation again.")
    return found


def ablation_metadata(folder: Path, facts: dict[str, Any]) -> dict[str, Any]:
    """Both arms' curves in one picture, and their figures side by side."""
    from pipeline.viewing.training_curves import discriminator_curves

    names = {"augmented": f"augmented ({facts['label']})", "original": "original clips only"}
    curves = {
        f"{names[each['arm']]}, seed {each['seed']}": pd.read_csv(folder / f"{each['name']}.csv")
        for each in facts["runs"]
    }
    rows = figure_rows(facts)
    return {
        "augmented arm": facts["label"],
        "origin": facts["origin"],
        "what it is": "a trial without a GPU: no result" if facts["trial"] else "full trainings",
        "D on policy samples": picture(discriminator_curves(curves, f"augmented: {facts['label']}")),
        **({"command and push figures": table_of(rows, list(rows))} if len(rows) else {}),
    }


def figure_rows(facts: dict[str, Any]) -> pd.DataFrame:
    """One row a figure, one column a run."""
    runs = {each["name"]: each["figures"] for each in facts["runs"]}
    names = list(dict.fromkeys(name for figures in runs.values() for name in figures))
    return pd.DataFrame(
        [{"figure": name, **{run: figures.get(name) for run, figures in runs.items()}} for name in names]
    )
