"""`augmentation_ablation`: two policies on one database, with and without augmented clips, same seeds and settings."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import dagster as dg
import pandas as pd

from assets.actuators import declared
from assets.amp_policy import bundle_of, run_facts, train_beside_others
from assets.plan import Plan
from assets.policy import NoPolicyError, result_of
from assets.project import DEFAULT_ROBOT, PROJECT, Project
from assets.report import as_failure, picture, table_of
from assets.resources import ClipPoolResource
from assets.training_process import TrainingConfig, asked_for, gpus_here, run_of
from pipeline.batch import Manifest
from pipeline.deployment import load_policy
from pipeline.files import atomic, digest
from pipeline.training.ablation_runs import CURVES, OPTION, POLICY, ArmRun, read_runs
from pipeline.training.config import texts_of
from pipeline.validation.deployed import deployed
from pipeline.validation.figures import measure
from pipeline.validation.sweep import error_of, sweep_cells

ARMS = {"augmented": True, "original": False}
"""Arm -> its value of the one option in which trainings differ, OPTION."""
FILE, SCHEMA = "ablation.json", "booster-lab augmentation ablation 1"
RECORDED = "augmentation_ablation"
"""Folder below the policies that ship where recorded curves lie."""
HERE, ELSEWHERE = "run here", "trained elsewhere, measured here"
"""Where an ablation comes from; what is recorded keeps it."""


class AblationConfig(TrainingConfig):
    """What both arms are trained with, or where they lie trained."""

    seeds: list[int] = [1]  # noqa: RUF012, a field
    runs: str = ""
    """Folder of runs that were trained elsewhere, `<arm>-seed<N>` each: absolute, or from where Dagster runs. Then
    nothing is trained; seeds, preset and options are those of the runs."""
    commit: str = ""
    """The commit whose code trained `runs`; needed with them."""


def augmentation_ablation(plan: Plan, database: Plan, adapted: Plan) -> Any:
    """The asset `augmentation_ablation` of a robot."""

    @dg.asset(**declared(plan, "pytorch", deps=[database.key, adapted.key]), output_required=False)
    def augmentation_ablation(
        context: dg.AssetExecutionContext, config: AblationConfig, clip_pool: ClipPoolResource
    ) -> Iterator[dg.MaterializeResult]:
        """The discriminator's score on policy samples, command and push figures with and without augmented clips."""
        if asked_for(context, plan):
            with as_failure():
                yield _measured(plan, config, clip_pool, context.log)

    return augmentation_ablation


def _measured(plan: Plan, config: AblationConfig, clip_pool: ClipPoolResource, log: Any) -> dg.MaterializeResult:
    """Train both arms or take those that are there, and state their figures."""
    robot = plan.robot or DEFAULT_ROBOT
    if config.runs or config.commit:
        folder = measure_runs(config, robot, clip_pool)
    elif config.device == "auto" and not gpus_here():
        folder = PROJECT.shipped_policies(robot) / RECORDED
        log.info(f"no GPU is here: the recorded curves of {folder.relative_to(PROJECT.root)} are served")
    else:
        folder = train_arms(config, robot, clip_pool, log)
    found = read_ablation(PROJECT, folder)
    origin = found.get("origin", HERE)
    if PROJECT.shipped_policies(robot) in folder.parents:
        origin = "recorded, ships with the project" + ("" if origin == HERE else f"; {origin}")
    facts = {**found, "stage": plan.name, "origin": origin, "folder": folder.relative_to(PROJECT.root).as_posix()}
    manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={RECORDED: facts})
    return result_of(plan, manifest, ablation_metadata(folder, facts), [])


def train_arms(config: AblationConfig, robot: str, pool: ClipPoolResource, log: Any) -> Path:
    """Train every arm with every seed, one after the other, and write what came of it; its folder."""
    bundle, about = bundle_of(PROJECT, robot)
    runs, curves = [], {}
    for seed in config.seeds:
        for arm, augmented in ARMS.items():
            asked = config.model_copy(update={"seed": seed})
            run = run_of(
                asked, PROJECT.policy_runs(robot), bundle, digest.of_json(about), options=texts_of({OPTION: augmented})
            )
            train_beside_others(run, PROJECT, robot, log)
            name = f"{arm}-seed{seed}"
            curves[name] = run.folder / CURVES
            facts = run_facts(run, robot)
            figures = {} if run.trial else figures_of(run.folder / POLICY, robot, pool)
            runs.append({"name": name, "arm": arm, "seed": seed, "run": facts, "figures": figures})
    trained = {"preset": config.preset, "options": config.options, "origin": HERE}
    return record(PROJECT.policies(robot) / RECORDED, about, runs, curves, trained)


def measure_runs(config: AblationConfig, robot: str, pool: ClipPoolResource) -> Path:
    """Measure arms that were trained elsewhere, and write what came of it; its folder.

    Raises NoPolicyError where the runs do not name their code, TrainingError for runs that are no ablation of
    what the project has now.
    """
    if not config.runs:
        raise NoPolicyError("'commit' is given without 'runs'. Name the folder of the runs that it trained too.")
    if not re.fullmatch(r"[0-9a-f]{7,40}\+?", config.commit):
        raise NoPolicyError(
            f"'commit' is '{config.commit}'. 'runs' needs the hash of the commit whose code trained them, with a '+' "
            "where files differed from it. In the checkout that trained: git rev-parse HEAD"
        )
    bundle, about = bundle_of(PROJECT, robot)
    found = read_runs(Path(config.runs).expanduser().resolve(), ARMS, bundle)
    runs = [
        {
            "name": each.name,
            "arm": each.arm,
            "seed": each.seed,
            "run": facts_of(each, robot, config.commit, bundle),
            "figures": figures_of(each.folder / POLICY, robot, pool),
        }
        for each in found
    ]
    curves = {each.name: each.folder / CURVES for each in found}
    trained = {"preset": found[0].config["preset"], "options": found[0].options, "origin": ELSEWHERE}
    return record(PROJECT.policies(robot) / RECORDED, about, runs, curves, trained)


def facts_of(run: ArmRun, robot: str, commit: str, bundle: Path) -> dict[str, Any]:
    """What is noted of a run that was trained elsewhere: as `run_facts`, but for its folder, and with its device."""
    return {
        "robot": robot,
        "run": run.name,
        "trial": False,
        "commit": commit,
        "command": run.command(bundle.relative_to(PROJECT.root)),
        "device": run.config["device"],
        "network": digest.of_file(run.folder / POLICY),
        "done": run.done,
    }


def record(
    folder: Path, about: dict[str, Any], runs: Sequence[Any], curves: Mapping[str, Path], trained: dict[str, Any]
) -> Path:
    """Write runs in the recorded form; the folder, which keeps nothing of an ablation before.

    Args:
        folder: where to
        about: the bundle that all were trained on
        runs: `name, arm, seed, run, figures` of each
        curves: name of a run -> its curves
        trained: `preset, options, origin` of all
    """
    for name, path in curves.items():
        atomic.write_bytes(folder / f"{name}.csv", path.read_bytes())
    value = {
        "schema": SCHEMA,
        "label": label_of(about["augmented_by"]),
        **trained,
        "database": about["database_digest"],
        "trial": any(each["run"]["trial"] for each in runs),
        "runs": runs,
        "files": {f"{name}.csv": digest.of_file(folder / f"{name}.csv") for name in curves},
    }
    atomic.write_text(folder / FILE, json.dumps(value, indent=1, sort_keys=True) + "\n")
    for path in folder.glob("*.csv"):
        if path.name not in value["files"]:
            path.unlink()
    return folder


def label_of(ways: Sequence[str]) -> str:
    """What the augmented arm has, "mirror and time-scale only": that nothing was tracked is not left to be guessed."""
    return " and ".join(filter(None, [", ".join(ways[:-1]), *ways[-1:]])) + " only" if ways else "no augmented clips"


def figures_of(policy: Path, robot: str, pool: ClipPoolResource) -> dict[str, float]:
    """Command and push figures of a policy in the sweep without noise in plain MuJoCo."""

    one = deployed(PROJECT.adapted_robot(robot), load_policy(policy))
    figures = {}
    for row in measure(one, sweep_cells(one.robot), pool.pool()):
        if row.cell.group.startswith("pushes"):
            figures[f"survival of {row.cell.name}"] = 1.0 - len(row.fallen) / len(row.trials)
            continue
        if row.cell.group == "commands":
            figures[f"error of {row.cell.name}"] = error_of(row)
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
    from pipeline.viewing.tracking_plots import discriminator_curves

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
        "iterations": ", ".join(f"{each['name']} {each['run']['done'].get('iterations')}" for each in facts["runs"]),
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
