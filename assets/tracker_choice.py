"""Tracker of a robot, and whether a policy training needs a new one.

A policy is trained on rollouts of a tracker. If the current tracker was not trained on all references, materializing
`amp_policy` on a GPU first trains a tracker on them; materializing only the database never trains.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import dagster as dg

from assets.plan import SHARED, robot_plans
from assets.training_process import gpus_here
from pipeline.batch import Manifest
from pipeline.project import DEFAULT_ROBOT, Project
from pipeline.tracking.tracker_folder import read_card

TRAINED, SHIPPED = "trained here", "ships with the project"
NEVER, CHANGED, ALWAYS = "never", "changed", "always"
"""When a tracker is trained; `changed`: if the current one was not trained on all references."""


def current_tracker(project: Project, robot: str) -> tuple[Path, str] | None:
    """Folder and origin of the tracker: trained here, else shipped; None if there is neither."""
    trained = project.policies(robot) / "tracker"
    if (trained / "card.json").is_file():
        return trained, TRAINED
    shipped = project.shipped_policies(robot) / "tracker"
    if (shipped / "card.json").is_file():
        return shipped, SHIPPED
    return None


def no_tracker(robot: str) -> str:
    """Message for a robot without a tracker."""
    job = job_of("train_tracker", robot)
    return (
        f"there is no tracker of '{robot}': none is shipped and none was trained here. The database therefore consists "
        f"of references that were not simulated. To use rollouts, run the job {job} on a machine with a GPU."
    )


def job_of(name: str, robot: str) -> str:
    """Name of a robot's job: `<name>_<robot>`; for the default robot `<name>`."""
    return name if robot == DEFAULT_ROBOT else f"{name}_{robot}"


def tracker_file(project: Project, tracking_policy: Manifest) -> tuple[Path, str] | None:
    """Path and digest of the network of a stored `tracking_policy`; None if the robot has none."""
    for facts in tracking_policy.settings.values():
        return project.root / facts["folder"] / "tracker.npz", facts["files"]["tracker.npz"]
    return None


def unknown_references(project: Project, robot: str, references: Manifest) -> list[str]:
    """References that the current tracker was not trained on; all if there is no tracker."""
    tracker = current_tracker(project, robot)
    known = set() if tracker is None else set(read_card(tracker[0]).clips)
    return sorted(clip for (clip,) in references.kept("clip") if clip not in known)


def trackers_for(
    selected: Collection[dg.AssetKey], run_config: Mapping[str, Any], stale: Collection[dg.AssetKey], project: Project
) -> dict[dg.AssetKey, dict[str, Any]]:
    """Trackers to train before policies: key of `tracking_policy` -> its config. Empty without a GPU.

    Args:
        selected: assets of the run; `amp_policy` of a robot needs a tracker
        run_config: config of the run; the tracker gets `device` and `gpus` of the policy
        stale: upstream assets that are materialized first; if the references are among them, the tracker decides
            after that whether it is trained
        project: project with the robots
    """
    found: dict[dg.AssetKey, dict[str, Any]] = {}
    if SHARED[0].key in selected:  # a run of all assets trains nothing (`is_requested`)
        return found
    for robot in project.robots:
        plans = robot_plans(robot)
        if plans["amp_policy"].key not in selected:
            continue
        op = run_config.get("ops", {}).get(plans["amp_policy"].key.to_python_identifier(), {})
        options = {name: value for name, value in op.get("config", {}).items() if name in ("device", "gpus")}
        device = options.get("device", "auto")
        if device == "cpu" or (device == "auto" and not gpus_here()):
            continue
        references = plans["reference_motions"].key
        if references in stale or unknown_references(project, robot, project.store.load(references.to_user_string())):
            found[plans["tracking_policy"].key] = {"train": CHANGED, **options}
    return found
