"""Notices logs that were dropped into data/hardware_logs and are complete, and has them ingested."""

import itertools

import dagster as dg

from assets.external import note_external
from assets.freshness import INPUT_VERSION_PREFIX, last_tags
from assets.hardware import HARDWARE_LOGS, logs_version
from assets.plan import FINGERPRINT_DIGITS, TRIALS
from assets.project import PROJECT
from pipeline.errors import PipelineError

EVERY_S = 30
MAX_RUNS = 3
"""Runs in a row that may fail for the same logs."""
LOGS_TAG = "booster_lab/logs"
"""Tag of a run: the content of the folder that it was started for."""

ingest_logs = dg.define_asset_job(
    "ingest_logs",
    selection=dg.AssetSelection.groups("field"),
    description="What the folder of logs holds as trials, and what is made of them. Nothing of it takes effect unseen.",
)


@dg.sensor(
    job=ingest_logs,
    minimum_interval_seconds=EVERY_S,
    default_status=dg.DefaultSensorStatus.RUNNING,
    description="Ingests new logs of data/hardware_logs, once each; what is still being copied waits.",
)
def hardware_log_sensor(context: dg.SensorEvaluationContext) -> dg.RunRequest | dg.SkipReason:
    """One run for each new content of the folder; one that failed, as its machine may have, is tried again."""
    try:
        version, facts = logs_version(PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"the folder of logs can't be looked at: {error}")
    count, waiting = facts["files"], facts["still being written"]
    tags = last_tags(context.instance, TRIALS.key)
    known = (tags or {}).get(INPUT_VERSION_PREFIX + HARDWARE_LOGS.to_user_string()) == version or not (count or tags)
    mark = {LOGS_TAG: version[:FINGERPRINT_DIGITS]}
    runs = context.instance.get_runs(filters=dg.RunsFilter(job_name=ingest_logs.name, tags=mark), limit=MAX_RUNS)
    if any(not run.is_finished for run in runs):
        return dg.SkipReason(f"a run was started for these {count} logs")
    failed = list(itertools.takewhile(lambda run: not run.is_success, runs))
    if known and not failed:
        return dg.SkipReason(f"no new log: {count} are ingested, {waiting} still being written")
    if len(failed) >= MAX_RUNS:
        return dg.SkipReason(
            f"{len(failed)} runs for these {count} logs failed; look at the last, or start one by hand"
        )
    try:
        note_external(context.instance, PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"no run can be started for these {count} logs: {error}")
    return dg.RunRequest(tags=mark)
