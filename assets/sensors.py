"""Sensors and schedules: ingest new logs, and bring approved changes to the page of curation_feedback and databases.

One sensor starts a run for new complete logs in data/hardware_logs. Another sensor checks every 30 s whether the page
or a database lacks approved changes; a nightly schedule does the same for changes that were approved while no sensor
ran. A failed run is repeated up to `MAX_FAILURES` times. None of them starts a training.
"""

import json

import dagster as dg

from assets.approved import (
    PAGE_TAG,
    PARTS,
    PROPOSAL,
    SHARED_PARTS,
    approved_key,
    approved_versions,
    shown_state,
)
from assets.bootstrap import note_external
from assets.freshness import INPUT_VERSION_PREFIX, last_tags
from assets.hardware import HARDWARE_LOGS, logs_version
from assets.plan import FIELD, FINGERPRINT_DIGITS, HARDWARE, SHARED, TRIALS, robot_plans
from assets.runs import recent_runs
from assets.sources import DATA_VERSION_TAG
from pipeline.errors import PipelineError
from pipeline.expert.history import was_restored
from pipeline.feedback.approved import EMPTY, applied_versions
from pipeline.files import digest
from pipeline.project import PROJECT, Project

renew_feedback_page = dg.define_asset_job(
    "renew_feedback_page",
    selection=dg.AssetSelection.assets(PROPOSAL),
    description="Renews the page of curation_feedback with the changes that are approved now.",
)


def page_request(instance: dg.DagsterInstance, project: Project) -> dg.RunRequest | None:
    """Request of a run that renews the page; None if it is current, was never made, or repeatedly failed."""
    tags, files = last_tags(instance, PROPOSAL), project.feedback
    state = shown_state(files.approvals(), files.declined_changes())
    if tags is None or tags.get(PAGE_TAG) == state:
        return None
    runs = dg.RunsFilter(job_name=renew_feedback_page.name)
    found = recent_runs(instance, project, runs, lambda run: run.tags.get(PAGE_TAG) == state)
    if found.why_not_now("the page", MAX_FAILURES, ""):
        return None
    return dg.RunRequest(job_name=renew_feedback_page.name, tags={PAGE_TAG: state})


EVERY_S = 30
"""Interval between two evaluations of a sensor [s]."""
MAX_FAILURES = 3
"""Failed runs in a row after which a sensor starts no more."""
MAX_NIGHTLY_TRIES = 2 * MAX_FAILURES
"""The same for the nightly schedule; higher, because the cause (a full disk, for example) may be gone by night."""

USED_BY = {"augmentation": "motion_variants", "weights": "feasible_motions", "motors": "adapted_robot"}
"""Section of a robot's feedback -> asset that uses it. `randomization` is missing: no sensor starts a training."""

APPROVED_TAG = "booster_lab/approved"
"""Tag of a run: digest of the approved changes when it was requested."""
DATABASES = tuple(robot_plans(robot)["expert_db"].key for robot in PROJECT.robots)

recurate = dg.define_asset_job(
    "recurate",
    selection=dg.AssetSelection.assets(*DATABASES),
    description="Re-curates the expert databases of all robots with the approved changes. Other results stay cached.",
)


def outdated_databases(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """Databases that lack changes that are approved now, each with the reason.

    Compares the versions that the stages' last runs and the databases recorded. A database that was never made is not
    outdated: its first run uses the approved changes. A version that a person restored stays until the approved changes
    differ.
    """
    versions = {key: version for key, (version, _) in approved_versions(project).items()}
    outdated: dict[dg.AssetKey, str] = {}
    for robot in project.robots:
        plans = {plan.name: plan for plan in SHARED} | robot_plans(robot)
        if last_tags(instance, plans["expert_db"].key) is None:
            continue
        restored = was_restored(project.expert_db(robot), project.feedback.approved)
        in_database = None if restored else _in_database(project, robot)
        for section in PARTS:
            name = "selected_motions" if section in SHARED_PARTS else USED_BY.get(section)
            if name is None:
                continue
            key = approved_key(section, robot)
            tags = last_tags(instance, plans[name].key)
            recorded = (tags or {}).get(INPUT_VERSION_PREFIX + key.to_user_string(), versions[key])
            if recorded != versions[key]:
                outdated[plans["expert_db"].key] = f"{key.to_user_string()} changed"
            elif in_database is not None and in_database.get(section, EMPTY) != versions[key]:
                outdated[plans["expert_db"].key] = f"{key.to_user_string()} is not in the database"
    return outdated


def _in_database(project: Project, robot: str) -> dict[str, str] | None:
    """Section -> version of the approved changes that a robot's database contains; None without a database."""
    try:
        return applied_versions(json.loads((project.expert_db(robot) / "manifest.json").read_text())["stages"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def recuration_request(instance: dg.DagsterInstance, project: Project, most: int) -> dg.RunRequest | dg.SkipReason:
    """Request of a run that brings approved changes into the databases, or the reason for none."""
    try:
        for section, fault in project.feedback.approvals().faults.items():
            if section in SHARED_PARTS or section in USED_BY:  # an unreadable file is a fault of all sections
                return dg.SkipReason(str(fault))
        outdated = outdated_databases(instance, project)
        state = digest.of_json({key.to_user_string(): each[0] for key, each in approved_versions(project).items()})
    except (PipelineError, OSError) as error:
        return dg.SkipReason(str(error))
    if not outdated:
        approved = project.feedback.approved
        restored = [robot for robot in project.robots if was_restored(project.expert_db(robot), approved)]
        left = f"; not updated, because a person restored them: {', '.join(restored)}" if restored else ""
        return dg.SkipReason(f"every database contains the approved changes{left}")
    reasons = "; ".join(f"{key.to_user_string()}: {why}" for key, why in sorted(outdated.items()))
    tag = {APPROVED_TAG: state[:FINGERPRINT_DIGITS]}
    runs = dg.RunsFilter(job_name=recurate.name)  # the databases are still outdated, so each finished run failed
    found = recent_runs(instance, project, runs, lambda run: run.tags.get(APPROVED_TAG) == tag[APPROVED_TAG])
    why = found.why_not_now(f"the approved changes ({reasons})", most, "start the job recurate by hand")
    if why:
        return dg.SkipReason(why)
    return dg.RunRequest(job_name=recurate.name, asset_selection=sorted(outdated), tags=tag)


@dg.sensor(
    name="approved_feedback_sensor",
    jobs=[renew_feedback_page, recurate],
    minimum_interval_seconds=EVERY_S,
    default_status=dg.DefaultSensorStatus.RUNNING,
    description="Renews the page of curation_feedback after approved changes, then re-curates the databases that lack "
    "them. A failed run is tried again twice.",
)
def approved_feedback_sensor(context: dg.SensorEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """Request a run for the page (seconds), else for outdated databases unless one is in progress."""
    return page_request(context.instance, PROJECT) or recuration_request(context.instance, PROJECT, MAX_FAILURES)


@dg.schedule(
    job=recurate,
    cron_schedule="0 3 * * *",
    default_status=dg.DefaultScheduleStatus.RUNNING,
    description="Re-curates at 03:00 every night the databases that lack approved changes.",
)
def nightly_recuration(context: dg.ScheduleEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """Request a run for outdated databases; skip if there are none."""
    return recuration_request(context.instance, PROJECT, MAX_NIGHTLY_TRIES)


LOGS_TAG = "booster_lab/logs"
"""Tag of a run: digest of the logs that it was started for."""

ingest_logs = dg.define_asset_job(
    "ingest_logs",
    selection=dg.AssetSelection.groups(HARDWARE),
    description="Ingests the logs of data/hardware_logs as trials, finds failures and proposes changes. No change "
    "takes effect without approval.",
)


def _reached_the_page(instance: dg.DagsterInstance, tag: dict[str, str]) -> bool:
    """Whether failures, proposal and report are up to date with the last trials, or a run with this tag succeeded."""
    done = dg.RunsFilter(job_name=ingest_logs.name, tags=tag, statuses=[dg.DagsterRunStatus.SUCCESS])
    if instance.get_runs(filters=done, limit=1):
        return True
    failures, feedback, report = FIELD
    for parent, child in ((TRIALS, failures), (failures, feedback), (failures, report)):
        made, used = last_tags(instance, parent.key) or {}, last_tags(instance, child.key) or {}
        if used.get(INPUT_VERSION_PREFIX + parent.key.to_user_string()) != made.get(DATA_VERSION_TAG):
            return False
    return True


@dg.sensor(
    job=ingest_logs,
    minimum_interval_seconds=EVERY_S,
    default_status=dg.DefaultSensorStatus.RUNNING,
    description="Ingests new logs of data/hardware_logs once each. Files that are still being copied wait.",
)
def hardware_log_sensor(context: dg.SensorEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """Request one run per new content of the folder. A failed run is tried again, a cancelled one is not."""
    try:
        version, facts = logs_version(PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"data/hardware_logs can't be read: {error}")
    count, waiting = facts["files"], facts["still being written"]
    tags = last_tags(context.instance, TRIALS.key)
    tag = {LOGS_TAG: version[:FINGERPRINT_DIGITS]}
    used = (tags or {}).get(INPUT_VERSION_PREFIX + HARDWARE_LOGS.to_user_string())
    ingested = not (count or tags) or (used == version and _reached_the_page(context.instance, tag))
    runs = dg.RunsFilter(job_name=ingest_logs.name, tags=tag)
    found = recent_runs(context.instance, PROJECT, runs, lambda run: not run.is_success)
    if ingested and not found.running and not found.failures:
        return dg.SkipReason(f"no new log: {count} are ingested, {waiting} still being written")
    why = found.why_not_now(f"these {count} logs", MAX_FAILURES, "start the job ingest_logs by hand")
    if why:
        return dg.SkipReason(why)
    try:
        note_external(context.instance, PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"no run can be started for these {count} logs: {error}")
    return dg.RunRequest(tags=tag)
