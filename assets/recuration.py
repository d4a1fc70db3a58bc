"""From what is approved to a new database: what re-curates when something was approved or taken back.

A sensor looks every half minute for approved changes that have not reached the page of curation_feedback, which is
made at once, or a database; a schedule once a night, for what was approved while nobody watched. A run that dies on the
way is tried again, a few times. Neither trains.
"""

import json

import dagster as dg

from assets.approved import PARTS, SHARED_PARTS, approvals_of, approved_key, approved_versions
from assets.freshness import INPUT_VERSION_PREFIX, last_tags
from assets.page_renewal import page_request, renew_feedback_page
from assets.plan import FINGERPRINT_DIGITS, SHARED, robot_plans
from assets.project import PROJECT, Project
from assets.run_tries import MAX_TRIES, Tries, tries
from pipeline.errors import PipelineError
from pipeline.feedback.approved import EMPTY, heard
from pipeline.files import digest

EVERY_S = 30
HEEDED_BY = {"augmentation": "motion_variants", "weights": "feasible_motions", "motors": "adapted_robot"}
"""Section of a robot's feedback -> its asset that heeds it. Training does too, but nothing here starts it."""

APPROVED_TAG = "booster_lab/approved"
"""Tag of a run: what was approved when it was asked for."""
MAX_NIGHTLY_TRIES = 2 * MAX_TRIES
"""The sensor gives up first; by night the machine may have room again."""

DATABASES = tuple(robot_plans(robot)[-1].key for robot in PROJECT.robots)

recurate = dg.define_asset_job(
    "recurate",
    selection=dg.AssetSelection.assets(*DATABASES),
    description="The expert databases of all robots with what is approved; what is not touched is not worked on.",
)


def behind(instance: dg.DagsterInstance, project: Project) -> dict[dg.AssetKey, str]:
    """Databases that what is approved now has not reached, with the reason.

    Stages are held to what they noted when they ran, databases to what they say of themselves. What was never made is
    not behind: its first run heeds what is approved then.
    """
    versions = {key: version for key, (version, _) in approved_versions(project).items()}
    late: dict[dg.AssetKey, str] = {}
    for robot in project.robots:
        plans = {plan.name: plan for plan in (*SHARED, *robot_plans(robot))}
        in_database = _in_database(project, robot)
        for section in PARTS:
            name = "selected_motions" if section in SHARED_PARTS else HEEDED_BY.get(section)
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
        for section, fault in approvals_of(project).faults.items():
            if section in SHARED_PARTS or section in HEEDED_BY:  # a file that can't be read faults all sections
                return dg.SkipReason(str(fault))
        late = behind(instance, project)
        state = digest.of_json({key.to_user_string(): each[0] for key, each in approved_versions(project).items()})
    except (PipelineError, OSError) as error:
        return dg.SkipReason(str(error))
    if not late:
        return dg.SkipReason("no database is behind what is approved")
    reasons = "; ".join(f"{key.to_user_string()}: {why}" for key, why in sorted(late.items()))
    mark = {APPROVED_TAG: state[:FINGERPRINT_DIGITS]}
    found = _tries(instance, project, mark)
    if found.at_work:
        return dg.SkipReason(f"a run was started for what is approved now ({reasons})")
    if found.cancelled:
        return dg.SkipReason(
            f"run {found.last_run} for what is approved now was cancelled ({reasons}); something else that is approved "
            "starts one, or start the job recurate by hand"
        )
    if found.in_vain >= most:
        return dg.SkipReason(
            f"{found.in_vain} runs for what is approved now came to nothing ({reasons}); "
            f"look at run {found.last_run}, then start the job recurate by hand"
        )
    return dg.RunRequest(job_name=recurate.name, asset_selection=sorted(late), tags=mark)


def _tries(instance: dg.DagsterInstance, project: Project, mark: dict[str, str]) -> Tries:
    """Runs since something else was approved, or somebody started one by hand. As databases are behind: in vain."""
    runs = dg.RunsFilter(job_name=recurate.name)
    return tries(instance, project, runs, lambda run: run.tags.get(APPROVED_TAG) == mark[APPROVED_TAG])


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
    return page_request(context.instance, PROJECT) or requested(context.instance, PROJECT, MAX_TRIES)


@dg.schedule(
    job=recurate,
    cron_schedule="0 3 * * *",
    default_status=dg.DefaultScheduleStatus.RUNNING,
    description="Every night, if what is approved has not reached a database.",
)
def nightly_recuration(context: dg.ScheduleEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """Skips where nothing changed."""
    return requested(context.instance, PROJECT, MAX_NIGHTLY_TRIES)
