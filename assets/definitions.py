"""Assembles the graph: sources, the shared stages, the stages of each robot, resources. Nothing else."""

from typing import Any

import dagster as dg

from assets.approval import approve_feedback, take_back_feedback
from assets.approved import approved_specs
from assets.bootstrap import serve
from assets.dataset_exports import dataset_exports
from assets.engine_assets import engine_assets
from assets.failure_modes import failure_modes
from assets.feedback import curation_feedback, sim_to_real_report
from assets.hardware import hardware_logs, hardware_trials
from assets.log_sensor import hardware_log_sensor, ingest_logs
from assets.motions import motion_catalog, repaired_motions, selected_motions
from assets.page_renewal import renew_feedback_page
from assets.plan import named_plans
from assets.policy_assets import policy_assets, training_jobs
from assets.project import PROJECT
from assets.recuration import approved_feedback_sensor, nightly_recuration, recurate
from assets.resources import ClipPoolResource, StoreIOManager
from assets.robot_motions import robot_assets
from assets.sources import raw_motions
from assets.tracking_policy import tracker_jobs
from assets.validation import validation_assets

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
        *validation_assets(_robot),
        *engine_assets(_robot),
    ]

defs = serve(
    dg.Definitions(
        assets=_assets,
        jobs=[
            ingest_logs,
            recurate,
            renew_feedback_page,
            approve_feedback,
            take_back_feedback,
            *training_jobs(PROJECT.robots),
            *tracker_jobs(PROJECT.robots, {robot: named_plans(robot)["tracking_policy"] for robot in PROJECT.robots}),
        ],
        sensors=[hardware_log_sensor, approved_feedback_sensor],
        schedules=[nightly_recuration],
        resources={"io_manager": StoreIOManager(), "clip_pool": ClipPoolResource()},
        executor=dg.in_process_executor,
    )
)
