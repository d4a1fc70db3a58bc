"""Notices logs that were dropped into data/hardware_logs and are complete, and has them ingested."""

import dagster as dg

from assets.external import note_external
from assets.freshness import INPUT_VERSION_PREFIX, last_tags
from assets.groups import HARDWARE
from assets.hardware import HARDWARE_LOGS, logs_version
from assets.plan import FINGERPRINT_DIGITS, TRIALS
from assets.project import PROJECT
from assets.run_tries import MAX_TRIES, tries
from pipeline.errors import PipelineError

EVERY_S = 30
LOGS_TAG = "booster_lab/logs"
"""Tag of a run: the content of the folder that it was started for."""

ingest_logs = dg.define_asset_job(
    "ingest_logs",
    selection=dg.AssetSelection.groups(HARDWARE),
    description="What the folder of logs holds as trials, and what is made of them. Nothing of it takes effect unseen.",
)


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
    known = (tags or {}).get(INPUT_VERSION_PREFIX + HARDWARE_LOGS.to_user_string()) == version or not (count or tags)
    mark = {LOGS_TAG: version[:FINGERPRINT_DIGITS]}
    runs = dg.RunsFilter(job_name=ingest_logs.name, tags=mark)
    found = tries(context.instance, PROJECT, runs, lambda run: not run.is_success)
    if found.at_work:
        return dg.SkipReason(f"a run was started for these {count} logs")
    if known and not found.in_vain:
        return dg.SkipReason(f"no new log: {count} are ingested, {waiting} still being written")
    if found.cancelled:
        return dg.SkipReason(
            f"run {found.last_run} for these {count} logs was cancelled; a new log starts one, or start one by hand"
        )
    if found.in_vain >= MAX_TRIES:
        return dg.SkipReason(
            f"{found.in_vain} runs for these {count} logs failed; look at {found.last_run}, or start one by hand"
        )
    try:
        note_external(context.instance, PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"no run can be started for these {count} logs: {error}")
    return dg.RunRequest(tags=mark)
