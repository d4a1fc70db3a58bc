"""KP4: tracking policy of a robot, shipped or trained here (on request, or before a policy training)."""

from pathlib import Path
from typing import Any, Literal

import dagster as dg

from assets.plan import Plan
from assets.report import result_of, robot_asset
from assets.resources import ClipPoolResource, store_released
from assets.tracker_choice import ALWAYS, CHANGED, NEVER, current_tracker, job_of, no_tracker, unknown_references
from assets.training_process import TRIAL_ENVS, TRIAL_ITERATIONS, Run, device_of, run_in, train
from pipeline.batch import Manifest
from pipeline.clips.robot_clip import RobotClip
from pipeline.expert.training_bundle import robot_facts
from pipeline.files import digest
from pipeline.learning.run_command import commit_of
from pipeline.project import DEFAULT_ROBOT, PROJECT
from pipeline.robot import load_robot
from pipeline.tracking.task import ITERATIONS
from pipeline.tracking.tracker_folder import read_card
from pipeline.tracking.write_bundle import write_tracking_bundle


class TrackerConfig(dg.Config):
    """When and how a tracker is trained."""

    train: Literal["never", "changed", "always"] = NEVER
    """When to train on the references here; `changed`: if the current tracker was not trained on all of them. The
    current tracker is the newest trained here, else the shipped one."""
    device: str = "auto"
    """`cuda`, `cpu` (a trial of two iterations), or `auto`: the GPU if there is one."""
    gpus: int = 1
    num_envs: int = 0
    """Number of environments per GPU; 0: 4096, or 8 in a trial."""
    iterations: int = 0
    """Number of iterations; 0: as for the shipped tracker (pipeline/tracking/task.py), or 2 in a trial."""
    minutes: float = 30.0
    """Time limit of the training [min], whatever the number of iterations."""
    seed: int = 1


@robot_asset("pytorch", "4")
def tracking_policy(
    context: dg.AssetExecutionContext,
    config: TrackerConfig,
    clip_pool: ClipPoolResource,
    reference_motions: Manifest,
    adapted_robot: Manifest,
    plan: Plan,
):
    """Policy that tracks reference motions in simulation: trained here, else the shipped one.

    Without either, the result is empty and the robot's database consists of references.
    """
    robot = plan.robot or DEFAULT_ROBOT
    if config.train == ALWAYS or (config.train == CHANGED and unknown_references(PROJECT, robot, reference_motions)):
        _train(plan, config, reference_motions, robot, clip_pool, context.log)
    tracker = current_tracker(PROJECT, robot)
    if tracker is None:
        why = no_tracker(robot)
        context.log.warning(why)
        return result_of(plan, {}, {"origin": why})
    folder, origin = tracker
    card = read_card(folder)
    unknown = unknown_references(PROJECT, robot, reference_motions)
    facts = {
        "stage": plan.name,
        "robot": robot,
        "origin": origin,
        "folder": folder.relative_to(PROJECT.root).as_posix(),
        "files": card.files,
        "licences": list(card.licences),
    }
    metadata = {
        "origin": origin,
        "folder": facts["folder"],
        "figures on its training clips": dg.MetadataValue.json(card.figures),
        "training": dg.MetadataValue.json(card.training),
        "training clips": f"{len(card.clips)} clips",
        "references it was not trained on": len(unknown),
        "licences": ", ".join(card.licences),
    }
    if unknown:
        context.log.warning(
            f"{len(unknown)} of {len(reference_motions.entries)} references are not among the tracker's training clips "
            f"(for example '{unknown[0]}'). If it does not follow them well, run the job "
            f"{job_of('train_tracker', robot)} on a machine with a GPU. A policy training on a GPU does this first."
        )
    return result_of(plan, {digest.of_json(card.files): facts}, metadata)


def _train(
    plan: Plan, config: TrackerConfig, references: Manifest, robot_name: str, clip_pool: ClipPoolResource, log: Any
) -> None:
    """Train on the references and export the tracker beside the policies. A trial on the CPU exports nothing."""
    from pipeline.tracking.export_tracker import export_tracker

    adapted = PROJECT.adapted_robot(robot_name)
    robot = load_robot(adapted)
    bundle = PROJECT.policies(robot_name) / "tracking_bundle"
    clips = (PROJECT.store.get_clip(entry.blob, entry.clip) for entry in references.entries)
    licences = [str(entry.numbers["licence"]) for entry in references.entries]
    about = write_tracking_bundle(
        bundle,
        [clip for clip in clips if isinstance(clip, RobotClip)],
        robot,
        robot_facts(robot, adapted),
        licences,
    )
    run = _run_of(config, PROJECT.policies(robot_name) / "tracker_runs", bundle, digest.of_json(about))
    commit = commit_of(PROJECT.root)
    with store_released(log):
        train(run, PROJECT.root, PROJECT.training_lock, log)
    if run.device == "cpu":
        log.warning(f"{run.folder.name} was a trial on a CPU: it only shows that training runs, and is not used.")
        return
    arguments = [text.replace(f"{PROJECT.root}/", "") for text in run.command]
    made = {"command": f"python {' '.join(arguments)}", "commit": commit}
    export_tracker(run.folder, bundle, adapted, PROJECT.policies(robot_name) / "tracker", made, clip_pool.pool())


def _run_of(config: TrackerConfig, runs: Path, bundle: Path, content: str) -> Run:
    """The run for a config on this machine; an equal request continues in the same folder."""
    device = device_of(config.device, config.gpus)
    trial = device == "cpu"
    request: dict[str, Any] = {
        "device": device,
        "gpus": 1 if trial else config.gpus,
        "num_envs": config.num_envs or (TRIAL_ENVS if trial else 4096),
        "iterations": config.iterations or (TRIAL_ITERATIONS if trial else ITERATIONS),
        "minutes": config.minutes,
        "seed": config.seed,
    }
    name = f"{'trial-' if trial else ''}seed{config.seed}-{digest.of_json([content, request])[:10]}"
    gpus, options = request.pop("gpus"), request | {"minutes": f"{config.minutes:g}"}
    return run_in(runs / name, bundle, "pipeline.tracking", gpus, "--resume", **options)
