"""Assembles the graph: sources, shared stages, the stages and policies of each robot, jobs, sensors, resources.

Also reduces how often Python's garbage collector runs.
"""

import gc
from typing import Any

import dagster as dg

from assets.amp_policy import amp_policy
from assets.approval import approve_feedback, take_back_feedback
from assets.approved import approved_specs
from assets.bootstrap import serve
from assets.database import dataset_exports
from assets.failure_modes import failure_modes
from assets.feedback import curation_feedback, sim_to_real_report
from assets.hardware import hardware_logs, hardware_trials
from assets.limit_cycles import limit_cycles
from assets.motions import motion_catalog, repaired_motions, selected_motions
from assets.plan import robot_plans
from assets.policy import exported_policy
from assets.release import release_report
from assets.report import assets_of
from assets.resources import ClipPoolResource, StoreIOManager
from assets.robot_motions import robot_assets
from assets.sensors import (
    approved_feedback_sensor,
    hardware_log_sensor,
    ingest_logs,
    nightly_recuration,
    recurate,
    renew_feedback_page,
)
from assets.source_jobs import rerun_source
from assets.sources import raw_motions
from assets.tracker_choice import ALWAYS, job_of
from assets.validation import cross_engine_validation, mujoco_validation, webots_validation
from pipeline.project import PROJECT


def policy_assets(robot: str) -> list[Any]:
    """Training, export, validations and release report of the robot in `robots/<robot>`."""
    validations = (mujoco_validation, cross_engine_validation, webots_validation, limit_cycles)
    return assets_of(robot, (amp_policy, exported_policy, *validations, release_report))


def training_jobs(robot: str) -> list[Any]:
    """The jobs `train` and `train_tracker` (for another robot `train_<robot>`, ...); only a person starts them."""
    policy, tracker = (robot_plans(robot)[name].key for name in ("amp_policy", "tracking_policy"))
    return [
        dg.define_asset_job(
            job_of("train", robot),
            selection=dg.AssetSelection.assets(policy),
            description="Brings the expert database up to date, then trains a policy on it.",
        ),
        dg.define_asset_job(
            job_of("train_tracker", robot),
            selection=dg.AssetSelection.assets(tracker),
            config={"ops": {tracker.to_python_identifier(): {"config": {"train": ALWAYS}}}},
            description="Brings the references up to date, then trains a tracking policy on them. Requires a GPU.",
        ),
    ]


_assets: list[Any] = [
    raw_motions,
    hardware_logs,
    hardware_trials,
    failure_modes,
    curation_feedback,
    sim_to_real_report,
    *approved_specs(None),
    motion_catalog,
    selected_motions,
    repaired_motions,
]
for _robot in PROJECT.robots:
    _assets += [
        *robot_assets(_robot),
        *dataset_exports(_robot),
        *policy_assets(_robot),
    ]

# Stages build tables of millions of objects, all in use: at the default threshold, collection would double the time.
gc.freeze()
gc.set_threshold(100_000)

defs = serve(
    dg.Definitions(
        assets=_assets,
        jobs=[
            ingest_logs,
            recurate,
            renew_feedback_page,
            approve_feedback,
            take_back_feedback,
            rerun_source,
            *(job for robot in PROJECT.robots for job in training_jobs(robot)),
        ],
        sensors=[hardware_log_sensor, approved_feedback_sensor],
        schedules=[nightly_recuration],
        resources={"io_manager": StoreIOManager(), "clip_pool": ClipPoolResource()},
        executor=dg.in_process_executor,
    )
)
