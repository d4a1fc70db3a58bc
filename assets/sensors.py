"""Sensors and schedules: new logs are ingested; approved changes reach the page of curation_feedback and the database.

One sensor looks for logs in data/hardware_logs that are complete. Another one looks every half minute for approved
changes that have not reached the page, which is made at once, or a database; a schedule does so once a night, for
changes that were approved while no sensor ran. A failed run is repeated up to `MAX_FAILURES` times.
None of them trains.
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
from pipeline.feedback.approved import EMPTY, heard
from pipeline.files import digest
from pipeline.project import PROJECT, Project

renew_feedback_page = dg.define_asset_job(
    "renew_feedback_page",
    selection=dg.AssetSelection.assets(PROPOSAL),
    description="The page of curation_feedback with what is approved now.",
)


def page_request(instance: dg.DagsterInstance, project: Project) -> dg.RunRequest | None:
    """The run that makes the page again; None where it is as it should be, was never made, or can't be made."""
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
"""Between two looks of a sensor [s]."""
MAX_FAILURES = 3
"""Failed runs in a row after which a person has to look."""
MAX_NIGHTLY_TRIES = 2 * MAX_FAILURES
"""The sensor gives up first; by night the machine may have room again."""

USED_BY = {"augmentation": "motion_variants", "weights": "feasible_motions", "motors": "adapted_robot"}
"""Section of a robot's feedback -> its asset that uses it. Training does too, but is not started here."""

APPROVED_TAG = "booster_lab/approved"
"""Tag of a run: what was approved when it was requested."""
DATABASES = tuple(robot_plans(robot)["expert_db"].key for robot in PROJECT.robots)

recurate = dg.define_asset_job(
    "recurate",
    selection=dg.AssetSelection.assets(*DATABASES),
    description="The expert databases of all robots with what is approved; what is not touched is not worked on.",
)


def behind(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """Databases that do not yet contain what is approved now, with the reason.

    Stages are compared by the versions that their last run recorded, databases by their own. What was never made is not
    behind: its first run uses what is approved then. A version that a person restored stays as long as nothing else is
    approved.
    """
    versions = {key: version for key, (version, _) in approved_versions(project).items()}
    late: dict[dg.AssetKey, str] = {}
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
            noted = (tags or {}).get(INPUT_VERSION_PREFIX + key.to_user_string(), versions[key])
            if noted != versions[key]:
                late[plans["expert_db"].key] = f"{key.to_user_string()} changed"
            elif in_database is not None and in_database.get(section, EMPTY) != versions[key]:
                late[plans["expert_db"].key] = f"{key.to_user_string()} did not reach the database"
    return late


def _in_database(project: Project, robot: str) -> dict[str, str] | None:
    """Section -> version of its approved part, as a robot's database has it; None where there is no database."""
    try:
        return heard(json.loads((project.expert_db(robot) / "manifest.json").read_text())["stages"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def requested(instance: dg.DagsterInstance, project: Project, most: int) -> dg.RunRequest | dg.SkipReason:
    """The run that brings what is approved into the databases, or why there is none."""
    try:
        for section, fault in project.feedback.approvals().faults.items():
            if section in SHARED_PARTS or section in USED_BY:  # a file that can't be read faults all sections
                return dg.SkipReason(str(fault))
        late = behind(instance, project)
        state = digest.of_json({key.to_user_string(): each[0] for key, each in approved_versions(project).items()})
    except (PipelineError, OSError) as error:
        return dg.SkipReason(str(error))
    if not late:
        approved = project.feedback.approved
        restored = [robot for robot in project.robots if was_restored(project.expert_db(robot), approved)]
        left = f"; a person restored those of {', '.join(restored)}, which are left as they are" if restored else ""
        return dg.SkipReason(f"no database is behind what is approved{left}")
    reasons = "; ".join(f"{key.to_user_string()}: {why}" for key, why in sorted(late.items()))
    mark = {APPROVED_TAG: state[:FINGERPRINT_DIGITS]}
    runs = dg.RunsFilter(job_name=recurate.name)  # the databases are still behind: each run that ended counts as failed
    found = recent_runs(instance, project, runs, lambda run: run.tags.get(APPROVED_TAG) == mark[APPROVED_TAG])
    why = found.why_not_now(f"what is approved now ({reasons})", most, "start the job recurate by hand")
    if why:
        return dg.SkipReason(why)
    return dg.RunRequest(job_name=recurate.name, asset_selection=sorted(late), tags=mark)


@dg.sensor(
    name="approved_feedback_sensor",
    jobs=[renew_feedback_page, recurate],
    minimum_interval_seconds=EVERY_S,
    default_status=dg.DefaultSensorStatus.RUNNING,
    description="Renews the page of curation_feedback when what is approved changed, then re-curates the databases "
    "that it has not reached; what fails is tried again twice.",
)
def approved_feedback_sensor(context: dg.SensorEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """The page first, which takes seconds; then a run while a database is behind and none is at work."""
    return page_request(context.instance, PROJECT) or requested(context.instance, PROJECT, MAX_FAILURES)


@dg.schedule(
    job=recurate,
    cron_schedule="0 3 * * *",
    default_status=dg.DefaultScheduleStatus.RUNNING,
    description="Every night, if what is approved has not reached a database.",
)
def nightly_recuration(context: dg.ScheduleEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """Skips where nothing changed."""
    return requested(context.instance, PROJECT, MAX_NIGHTLY_TRIES)


LOGS_TAG = "booster_lab/logs"
"""Tag of a run: the content of the folder that it was started for."""

ingest_logs = dg.define_asset_job(
    "ingest_logs",
    selection=dg.AssetSelection.groups(HARDWARE),
    description="What the folder of logs holds as trials, and what is made of them. Nothing of it takes effect unseen.",
)


def _reached_the_page(instance: dg.DagsterInstance, mark: dict[str, str]) -> bool:
    """Whether failures, proposal and report are of the last trials, which a person may have ingested by hand, or
    a run with this mark made them."""
    done = dg.RunsFilter(job_name=ingest_logs.name, tags=mark, statuses=[dg.DagsterRunStatus.SUCCESS])
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
    description="Ingests new logs of data/hardware_logs, once each; what is still being copied waits.",
)
def hardware_log_sensor(context: dg.SensorEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """One run for each new content of the folder; one that failed, as its machine may have, is tried again, one that
    a person cancelled is not."""
    try:
        version, facts = logs_version(PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"the folder of logs can't be looked at: {error}")
    count, waiting = facts["files"], facts["still being written"]
    tags = last_tags(context.instance, TRIALS.key)
    mark = {LOGS_TAG: version[:FINGERPRINT_DIGITS]}
    used = (tags or {}).get(INPUT_VERSION_PREFIX + HARDWARE_LOGS.to_user_string())
    known = not (count or tags) or (used == version and _reached_the_page(context.instance, mark))
    runs = dg.RunsFilter(job_name=ingest_logs.name, tags=mark)
    found = recent_runs(context.instance, PROJECT, runs, lambda run: not run.is_success)
    if known and not found.running and not found.failures:
        return dg.SkipReason(f"no new log: {count} are ingested, {waiting} still being written")
    why = found.why_not_now(f"these {count} logs", MAX_FAILURES, "start the job ingest_logs by hand")
    if why:
        return dg.SkipReason(why)
    try:
        note_external(context.instance, PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"no run can be started for these {count} logs: {error}")
    return dg.RunRequest(tags=mark)
