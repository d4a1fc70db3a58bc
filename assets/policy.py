"""`amp_policy`: a policy trained on the expert database; `exported_policy`: the one that validation and robot take."""

import dataclasses
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import dagster as dg
import pandas as pd

from assets.actuators import declared
from assets.approved import approved_key, approved_part
from assets.plainly import plainly
from assets.plan import FAULTS_TAG, FINGERPRINT_TAG, Plan
from assets.project import DEFAULT_ROBOT, PROJECT, Project
from assets.report import picture, table_of
from assets.resources import ClipPoolResource
from assets.training_process import Run, TrainingConfig, run_of, train
from pipeline.batch import Manifest
from pipeline.errors import PipelineError
from pipeline.files import digest

EXACT = "gives_the_networks_actions"
MAY_SHIP = "may_ship"
TRAINED, SHIPPED = "trained here", "ships with the project"
"""Where an exported policy comes from; the one is never told as the other."""


class NoPolicyError(PipelineError):
    """There is no policy to serve."""


class AmpConfig(TrainingConfig):
    """What is trained, and how its checkpoint is chosen."""

    choose_from: int = 5
    """The last checkpoints that are swept in plain MuJoCo; the best is the policy. 0: the newest, unswept."""


class ExportConfig(dg.Config):
    """How the policy is marked."""

    shippable: bool = False
    """Mark a policy that was trained here as one that may ship. Refused where its database's licence forbids it."""


def amp_policy(plan: Plan, database: Plan, adapted: Plan) -> Any:
    """The asset `amp_policy` of a robot."""

    deps = [database.key, adapted.key, approved_key("randomization", plan.robot)]

    @dg.asset(**declared(plan, "pytorch", deps=deps))
    @plainly
    def amp_policy(context: dg.AssetExecutionContext, config: AmpConfig, clip_pool: ClipPoolResource):
        """A policy trained by AMP on the expert database, in a process of its own; a trial of it where no GPU is."""
        robot = plan.robot or DEFAULT_ROBOT
        bundle, about = bundle_of(PROJECT, robot)
        wider = widened(config.preset, approved_part(PROJECT, "randomization", plan.robot))
        run = run_of(config, PROJECT.policy_runs(robot), bundle, digest.of_json(about), options=wider)
        commit = commit_of(PROJECT)
        train(run, PROJECT.root, PROJECT.training_lock, context.log)
        chosen, sweep = choose_checkpoint(run, robot, config.choose_from, clip_pool)
        facts = run_facts(run, robot, commit) | {
            "stage": plan.name,
            "policy": chosen.relative_to(run.folder).as_posix(),
        }
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={run.folder.name: facts})
        metadata = {**curves_of(run.folder), **sweep, **_told(run, facts, about)}
        return result_of(plan, manifest, metadata, [])

    return amp_policy


def exported_policy(plan: Plan, trained: Plan, model: Plan) -> Any:
    """The asset `exported_policy` of a robot."""
    specs = [
        dg.AssetCheckSpec(EXACT, asset=plan.key, blocking=True, description="ONNX and TorchScript are the network's."),
        dg.AssetCheckSpec(MAY_SHIP, asset=plan.key, description="The licence of its expert database lets it ship."),
    ]

    @dg.asset(**declared(plan, "onnx", deps=[trained.key, model.key]), check_specs=specs)
    @plainly
    def exported_policy(context: dg.AssetExecutionContext, config: ExportConfig):
        """The policy as ONNX, TorchScript, golden vectors, model card and booster_deploy task; trained or shipped."""
        robot = plan.robot or DEFAULT_ROBOT
        folder, origin = serve(PROJECT, robot, trained, shippable=config.shippable)
        export = read_served_folder(folder, robot)
        card = export.card
        context.log.info(f"policy '{card.name}' of run '{card.run.get('name')}': {origin}")
        facts = {
            "stage": plan.name,
            "robot": robot,
            "name": card.name,
            "origin": origin,
            "run": card.run.get("name", "not stated"),
            "digest": card.digest,
            "database": card.data.get("digest", "not stated"),
            "shippable": card.shippable,
            "folder": folder.relative_to(PROJECT.root).as_posix(),
            "files": card.files,
        }
        manifest = Manifest(stage=plan.name, entries=(), judged=(), settings={card.digest: facts})
        return result_of(plan, manifest, _export_metadata(export, origin), _export_checks(plan, card))

    return exported_policy


def serve(project: Project, robot: str, trained: Plan, *, shippable: bool) -> tuple[Path, str]:
    """Folder of the policy to take, and where it comes from: a full training here, else the one that ships.

    Raises NoPolicyError where there is neither, ExportError where it is to be marked shippable and may not.
    """
    import numpy as np

    from pipeline.export.folder import CURVES, Source, export_policy
    from pipeline.export.training_run import training_data, training_run
    from pipeline.robot import load_robot

    facts = full_training(project, trained)
    if facts is None:
        shipped = project.shipped_policies(robot) / "walk"
        if not (shipped / "card.json").is_file():
            raise NoPolicyError(
                f"there is no policy of '{robot}': {shipped.relative_to(project.root)} ships none, and none was "
                "trained here in full. On a machine with a GPU: dagster asset materialize --select amp_policy"
            )
        return shipped, SHIPPED
    run = project.root / facts["folder"]
    curves = run / CURVES
    source = Source(
        policy=run / facts["policy"],
        run=training_run(run, commit=facts["commit"], command=facts["command"]),
        data=training_data(run),
        curves=curves if curves.is_file() else None,
    )
    folder = project.exported_policy(robot)
    adapted = load_robot(project.robot_folder(robot))
    export_policy(folder, facts["run"], adapted, source, np.random.default_rng(0), shippable=shippable)
    return folder, TRAINED


def full_training(project: Project, trained: Plan) -> dict[str, Any] | None:
    """What `amp_policy` said of its training, if that was one and not a trial, and its network is still there."""
    path = project.store.manifest_path(trained.key.to_user_string())
    if not path.is_file():
        return None
    (facts,) = project.store.load(trained.key.to_user_string()).settings.values()
    there = (project.root / facts["folder"] / facts["policy"]).is_file()
    return None if facts["trial"] or not there else facts


def read_served_folder(folder: Path, robot: str) -> Any:
    """The whole export in a folder. Raises FileError where a file isn't the one its card states."""
    from pipeline.export.folder import read_export
    from pipeline.robot import load_robot

    return read_export(folder, load_robot(PROJECT.robot_folder(robot)))


def served(manifest: Manifest) -> dict[str, Any]:
    """What `exported_policy` said: `robot, name, origin, run, digest, database, shippable, folder, files`."""
    (facts,) = manifest.settings.values()
    return facts


def served_policy(manifest: Manifest) -> Any:
    """The network that `exported_policy` serves (`pipeline.deployment.Policy`)."""
    from pipeline.deployment import load_policy
    from pipeline.export.folder import POLICY

    return load_policy(PROJECT.root / served(manifest)["folder"] / POLICY)


def widened(preset_name: str, changes: Sequence[Any]) -> tuple[str, ...]:
    """The options of a preset that approved changes widen: each change is a new end of a range, none narrows one."""
    from pipeline.training.presets import preset

    ends = {change.what: list(getattr(preset(preset_name), change.what)) for change in changes}
    for change in changes:
        low, high = ends[change.what]
        lower = change.value < change.before
        ends[change.what] = [min(low, change.value), high] if lower else [low, max(high, change.value)]
    return tuple(f"{name}={low:g},{high:g}" for name, (low, high) in sorted(ends.items()))


def bundle_of(project: Project, robot: str) -> tuple[Path, dict[str, Any]]:
    """The files that training takes, written from the database and the adapted robot; where, and what they are."""
    from pipeline.expert.training_bundle import write_training_bundle

    folder = project.policies(robot) / "bundle"
    return folder, write_training_bundle(folder, project.expert_db(robot), project.adapted_robot(robot))


def choose_checkpoint(run: Run, robot: str, count: int, pool: ClipPoolResource) -> tuple[Path, dict[str, Any]]:
    """The npz of the best of the last `count` checkpoints in a sweep, and what is told of it; of a trial the newest."""
    newest = run.folder / "policy.npz"
    if run.trial or count == 0:
        why = "a trial" if run.trial else "asked for"
        return newest, {"checkpoint": f"the newest, not swept: {why}"}
    from assets.training_process import policy_of_checkpoint
    from pipeline.deployment import load_policy
    from pipeline.validation.checkpoint_choice import best, sweep_checkpoints
    from pipeline.validation.deployed import deployed

    states = sorted((run.folder / "checkpoints").glob("model_*.pt"))[-count:]
    files = {int(path.stem.split("_")[1]): policy_of_checkpoint(run, path, PROJECT.root) for path in states}
    robots = {number: deployed(PROJECT.adapted_robot(robot), load_policy(path)) for number, path in files.items()}
    found = sweep_checkpoints(robots, pool.pool())
    chosen = best(found)
    rows = pd.DataFrame([each.to_dict() for each in found])
    said = f"iteration {chosen.iteration}, the best of {len(found)} in the sweep without noise"
    return files[chosen.iteration], {"checkpoint": said, "sweep of checkpoints": table_of(rows, list(rows))}


def run_facts(run: Run, robot: str, commit: str) -> dict[str, Any]:
    """What is noted of a run that is done."""
    import json

    return {
        "robot": robot,
        "run": run.folder.name,
        "folder": run.folder.relative_to(PROJECT.root).as_posix(),
        "trial": run.trial,
        "commit": commit,
        "command": _portable(run),
        "network": digest.of_file(run.folder / "policy.npz"),
        "done": json.loads((run.folder / "done.json").read_text()),
    }


def _portable(run: Run) -> str:
    """The command that makes the run again, with paths from the project's root."""
    near = dataclasses.replace(
        run, folder=run.folder.relative_to(PROJECT.root), bundle=run.bundle.relative_to(PROJECT.root)
    )
    return f"python {' '.join(near.command)}"


def commit_of(project: Project) -> str:
    """The commit that the code is at, with `+` where files differ from it; empty outside a repository."""
    try:
        head = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=project.root, capture_output=True, text=True, check=True
        )
        state = ["git", "status", "--porcelain", "--untracked-files=no"]
        changed = subprocess.run(state, cwd=project.root, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return head.stdout.strip() + ("+" if changed.stdout.strip() else "")


def curves_of(folder: Path) -> dict[str, Any]:
    """A run's curves as a picture, and its last figures as numbers that plot over materializations."""
    from pipeline.viewing.training_curves import training_curves

    path = folder / "curves.csv"
    if not path.is_file():
        return {}
    table = pd.read_csv(path)
    last = table.iloc[-1]
    shown = ("task_reward", "style_reward", "d_expert", "d_policy", "episode_s", "steps_per_s")
    numbers = {name: float(last[name]) for name in shown if name in table and last[name] == last[name]}
    bins = [name.removesuffix("_commanded") for name in table if name.endswith("_commanded")]
    speeds = pd.DataFrame(
        [{"command": name, **{kind: last[f"{name}_{kind}"] for kind in ("commanded", "achieved")}} for name in bins]
    )
    achieved = {"achieved against commanded velocity": table_of(speeds, list(speeds))} if bins else {}
    return {**numbers, "curves": picture(training_curves({"": table})), **achieved}


def _told(run: Run, facts: dict[str, Any], about: dict[str, Any]) -> dict[str, Any]:
    return {
        "run": facts["run"],
        "what it is": "a trial: a few iterations without a GPU, no policy" if run.trial else "a full training",
        "iterations": facts["done"].get("iterations", 0),
        "seconds": float(facts["done"].get("seconds", 0.0)),
        "command": facts["command"],
        "commit": facts["commit"],
        "expert database": about["database_digest"],
        "strictest licence": about["licence"]["strictest"],
        "dagster/uri": dg.MetadataValue.path(str(run.folder)),
    }


def _export_metadata(export: Any, origin: str) -> dict[str, Any]:
    from pipeline.export.card import page

    card = export.card
    metadata: dict[str, Any] = {
        "policy": card.name,
        "origin": origin,
        "made by run": str(card.run.get("name", "not stated")),
        "digest": card.digest,
        "expert database": str(card.data.get("digest", "not stated")),
        "may ship": card.shippable,
        "why": card.why,
        "largest difference of ONNX": float(card.parity["onnx"]),
        "largest difference of TorchScript": float(card.parity["torch_script"]),
        "card": dg.MetadataValue.md(page(card)),
        "dagster/uri": dg.MetadataValue.path(str(export.folder)),
    }
    curves = curves_of(export.folder)
    return metadata | ({"curves of the run that made it": curves["curves"]} if curves else {})


def _export_checks(plan: Plan, card: Any) -> list[dg.AssetCheckResult]:
    worst = max(card.parity["onnx"], card.parity["torch_script"])
    from pipeline.export.parity import TOLERANCE

    exact = dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=EXACT,
        passed=worst <= TOLERANCE,
        metadata={"found": f"{worst:.1e} over {card.parity['observations']} observations, allowed {TOLERANCE:.0e}"},
    )
    ships = dg.AssetCheckResult(
        asset_key=plan.key,
        check_name=MAY_SHIP,
        passed=card.shippable,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": f"{'marked' if card.shippable else 'not marked'} as one that may ship. {card.why}"},
    )
    return [exact, ships]


def result_of(
    plan: Plan, manifest: Manifest, metadata: dict[str, Any], checks: list[dg.AssetCheckResult]
) -> dg.MaterializeResult:
    """The result that Dagster notes: content as data version, what it depended on as a tag; tables come last."""
    return dg.MaterializeResult(
        asset_key=plan.key,
        value=manifest,
        metadata=dict(sorted(metadata.items(), key=lambda item: isinstance(item[1], dg.TableMetadataValue))),
        check_results=checks,
        data_version=dg.DataVersion(manifest.digest),
        tags={FINGERPRINT_TAG: plan.fingerprint(PROJECT), FAULTS_TAG: "0"},
    )
