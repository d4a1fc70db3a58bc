"""Notices logs that were dropped into data/hardware_logs and are complete, and has them ingested."""

import dagster as dg

from assets.external import note_external
from assets.freshness import INPUT_VERSION_PREFIX, last_tags
from assets.hardware import HARDWARE_LOGS, logs_version
from assets.plan import TRIALS
from assets.project import PROJECT
from pipeline.errors import PipelineError

EVERY_S = 30

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
def hardware_log_sensor(context: dg.SensorEvaluationContext) -> dg.SensorResult | dg.SkipReason:
    """The cursor is the content that a run was last started for: a log that comes a second time starts none."""
    try:
        version, facts = logs_version(PROJECT)
    except (PipelineError, OSError) as error:
        return dg.SkipReason(f"the folder of logs can't be looked at: {error}")
    count, waiting = facts["files"], facts["still being written"]
    tags = last_tags(context.instance, TRIALS.key)
    if (tags or {}).get(INPUT_VERSION_PREFIX + HARDWARE_LOGS.to_user_string()) == version or not (count or tags):
        return dg.SkipReason(f"no new log: {count} are ingested, {waiting} still being written")
    if version == context.cursor:
        return dg.SkipReason(f"a run was started for these {count} logs")
    note_external(context.instance, PROJECT)
    return dg.SensorResult(run_requests=[dg.RunRequest()], cursor=version)
