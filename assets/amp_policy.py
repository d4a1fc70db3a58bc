"""`amp_policy`: a policy trained on the expert database in a separate process; a sweep selects its checkpoint."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import dagster as dg

from assets.approved import approved_part
from assets.plan import Plan, robot_plans
from assets.report import result_of, robot_asset
from assets.resources import store_released
from assets.tracker_choice import tracker_file
from assets.training_process import (
    Run,
    TrainingConfig,
    TrainingFailedError,
    curves_of,
    is_requested,
    run_of,
    train,
    validation_of,
)
from pipeline.clips.robot_clip import RobotClip
from pipeline.expert import manifest
from pipeline.expert.training_bundle import TrackedClip, TrackerFiles, write_training_bundle
from pipeline.files import digest
from pipeline.files.swap import current
from pipeline.project import DEFAULT_ROBOT, PROJECT, Project
from pipeline.training.config import preset

TRACKED = ("reference_motions", "augmented_motions", "tracking_policy")
"""Inputs of distillation: the references, the tracker's rollouts of them, and the tracker."""


@robot_asset("pytorch", deps=["expert_db", "adapted_robot", "approved_randomization", *TRACKED], output_required=False)
def amp_policy(context: dg.AssetExecutionContext, config: TrainingConfig, plan: Plan) -> Iterator[dg.MaterializeResult]:
    """Walking policy trained by AMP on the expert database. Without a GPU, a trial of a few iterations runs instead."""
    if is_requested(context, plan):
        yield _trained(plan, config, context.log)


def _trained(plan: Plan, config: TrainingConfig, log: Any) -> dg.MaterializeResult:
    """Train, then collect the curves, the validation and the facts of the run."""
    robot = plan.robot or DEFAULT_ROBOT
    bundle, about = bundle_of(PROJECT, robot)
    wider = widened(config.preset, approved_part(PROJECT, "randomization", plan.robot))
    run = run_of(config, PROJECT.policy_runs(robot), bundle, digest.of_json(about), options=wider)
    train_beside_others(run, PROJECT, robot, log)
    facts = run_facts(run, robot) | {"stage": plan.name, "policy": "policy.npz"}
    metadata = {**curves_of(run.folder), **validation_of(run.folder), **_metadata(run, facts, about)}
    return result_of(plan, {run.folder.name: facts}, metadata)


WIDENED = {"friction": "randomization.friction", "gain_range": "randomization.gains", "push_speed": "pushes.kick_m_s"}
"""Range of an approved change -> training option."""


def widened(preset_name: str, changes: Sequence[Any]) -> tuple[str, ...]:
    """Widen ranges of a preset by approved changes, as options `name=low,high`.

    Each change moves one end of a range outwards; none narrows a range. The maximum push speed is scaled by the ratio
    of the approved change, because presets have different maxima.
    """
    values = preset(preset_name).values()
    ends: dict[str, tuple[float, float]] = {}
    for change in changes:
        name = WIDENED[change.what]
        low, high = ends[name] if name in ends else values[name]
        new = high * change.value / change.before if change.what == "push_speed" else change.value
        ends[name] = (min(low, new), high) if new < change.before else (low, max(high, new))
    return tuple(f"{name}={low:g},{high:g}" for name, (low, high) in sorted(ends.items()))


def bundle_of(project: Project, robot: str) -> tuple[Path, dict[str, Any]]:
    """Write the training bundle from database, adapted robot and tracker. Returns its folder and its facts."""
    folder = project.policies(robot) / "bundle"
    tracker = tracker_files(project, robot)
    return folder, write_training_bundle(folder, project.expert_db(robot), project.adapted_robot(robot), tracker)


def tracker_files(project: Project, robot: str) -> Any:
    """Tracker network and the pairs of reference and undisturbed rollout that reach the last frame.

    None if an asset of `TRACKED` has no stored result, or there is no tracker.
    """
    plans = robot_plans(robot)
    names = [plans[name].key.to_user_string() for name in TRACKED]
    if not all(project.store.manifest_path(name).is_file() for name in names):
        return None
    references, rollouts, policy = (project.store.load(name) for name in names)
    blobs = {entry.clip: entry.blob for entry in references.entries}
    clips = []
    for entry in rollouts.entries:
        numbers = entry.numbers
        name = str(numbers["reference"])
        if numbers["rollout"] or not numbers["survived"] or name not in blobs:
            continue
        reference, rollout = project.store.get_clip(blobs[name], name), project.store.get_clip(entry.blob, entry.clip)
        if isinstance(reference, RobotClip) and isinstance(rollout, RobotClip):
            clips.append(TrackedClip(reference=reference, rollout=rollout))
    found = tracker_file(project, policy)
    return None if found is None else TrackerFiles(network=found[0], clips=clips)


def train_beside_others(run: Run, project: Project, robot: str, log: Any) -> None:
    """Train without holding the lock on the store. Raises TrainingFailedError if the inputs changed meanwhile."""
    before = _trained_on(run, project, robot)
    with store_released(log):
        train(run, project.root, project.training_lock, log)
    if _trained_on(run, project, robot) != before:
        raise TrainingFailedError(
            f"{run.folder.name}: the expert database or the adapted robot changed while it trained. Its files are "
            "kept. Materialize again to train on the present ones."
        )


def _trained_on(run: Run, project: Project, robot: str) -> str:
    """Digest of adapted robot, database and bundle; for the last two, of the manifests, which hold file digests."""
    adapted, database = project.adapted_robot(robot), current(project.expert_db(robot))
    files = [path for path in adapted.rglob("*") if path.is_file()]
    heads = (database / manifest.FILE, run.bundle / "bundle.json")
    stated = [digest.of_file(path) for path in heads if path.is_file()]
    return digest.of_json([digest.of_files(sorted(files), adapted), *stated])


def run_facts(run: Run, robot: str) -> dict[str, Any]:
    """Facts of a finished run, for the manifest."""
    config = json.loads((run.folder / "config.json").read_text())
    return {
        "robot": robot,
        "run": run.folder.name,
        "folder": run.folder.relative_to(PROJECT.root).as_posix(),
        "trial": run.trial,
        **{name: config[name] for name in ("commit", "command")},
        "network": digest.of_file(run.folder / "policy.npz"),
        "done": json.loads((run.folder / "done.json").read_text()),
    }


def _metadata(run: Run, facts: dict[str, Any], about: dict[str, Any]) -> dict[str, Any]:
    return {
        "run": facts["run"],
        "type of run": "a trial: a few iterations without a GPU, no policy" if run.trial else "a full training",
        **({"checkpoint": "the newest, not validated: a trial"} if run.trial else {}),
        "iterations": facts["done"].get("iterations", 0),
        "seconds": float(facts["done"].get("seconds", 0.0)),
        "command": facts["command"],
        "commit": facts["commit"],
        "expert database": about["database_digest"],
        "strictest licence": about["licence"]["strictest"],
        "dagster/uri": dg.MetadataValue.path(str(run.folder)),
    }
