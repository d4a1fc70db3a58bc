"""Which tracker a robot has, and whether its policy needs another one.

A policy is trained on rollouts of a tracker. Where the references have other clips than the served tracker was trained
on, making `amp_policy` on a GPU trains a tracker on them first; making the database alone never does.
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
"""When a tracker is trained; `changed`: where the served one was trained on other clips."""


def served_tracker(project: Project, robot: str) -> tuple[Path, str] | None:
    """Folder of the tracker to use, and where it comes from; None where there is none."""
    trained = project.policies(robot) / "tracker"
    if (trained / "card.json").is_file():
        return trained, TRAINED
    shipped = project.shipped_policies(robot) / "tracker"
    if (shipped / "card.json").is_file():
        return shipped, SHIPPED
    return None


def no_tracker(robot: str) -> str:
    """The message where a robot has no tracker."""
    job = job_of("train_tracker", robot)
    return (
        f"there is no tracker of '{robot}': none ships, and none was trained here. The database is made of references "
        f"that no simulation has tested. To make it of rollouts, run the job {job} on a machine with a GPU."
    )


def job_of(name: str, robot: str) -> str:
    """Name of a robot's job; those of the default robot are bare."""
    return name if robot == DEFAULT_ROBOT else f"{name}_{robot}"


def tracker_file(project: Project, tracking_policy: Manifest) -> tuple[Path, str] | None:
    """The network of a stored `tracking_policy` and its digest; None where the robot has none."""
    for facts in tracking_policy.settings.values():
        return project.root / facts["folder"] / "tracker.npz", facts["files"]["tracker.npz"]
    return None


def unknown_references(project: Project, robot: str, references: Manifest) -> list[str]:
    """The references that the served tracker was not trained on; all of them where there is no tracker."""
    served = served_tracker(project, robot)
    known = set() if served is None else set(read_card(served[0]).clips)
    return sorted(clip for (clip,) in references.kept("clip") if clip not in known)


def trackers_for(
    selected: Collection[dg.AssetKey], run_config: Mapping[str, Any], stale: Collection[dg.AssetKey], project: Project
) -> dict[dg.AssetKey, dict[str, Any]]:
    """The trackers to make before policies: key of `tracking_policy` -> its config. None without a GPU.

    Args:
        selected: the assets of a run; those named `amp_policy` need a tracker
        run_config: of that run; `device` and `gpus` of a policy are also its tracker's
        stale: what is made anew upstream; a tracker after new references decides when they are made
    """
    found: dict[dg.AssetKey, dict[str, Any]] = {}
    if SHARED[0].key in selected:  # a run of everything trains nothing (`asked_for`)
        return found
    for robot in project.robots:
        plans = robot_plans(robot)
        if plans["amp_policy"].key not in selected:
            continue
        op = run_config.get("ops", {}).get(plans["amp_policy"].key.to_python_identifier(), {})
        asked = {name: value for name, value in op.get("config", {}).items() if name in ("device", "gpus")}
        device = asked.get("device", "auto")
        if device == "cpu" or (device == "auto" and not gpus_here()):
            continue
        references = plans["reference_motions"].key
        if references in stale or unknown_references(project, robot, project.store.load(references.to_user_string())):
            found[plans["tracking_policy"].key] = {"train": CHANGED, **asked}
    return found
