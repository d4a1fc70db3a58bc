"""Logs of the robot: the folder they are dropped into, and the trials that are made of them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dagster as dg
import pandas as pd

from assets.log_ingest import ingest_folder
from assets.plan import FAULTS_TAG, FINGERPRINT_TAG, HARDWARE, TRIALS
from assets.project import PROJECT, Project
from assets.report import plain_errors, table_of
from pipeline.batch import Manifest
from pipeline.files import digest, settings
from pipeline.hardware_logs import LogSettings
from pipeline.hardware_logs.log_folder import complete_logs

HARDWARE_LOGS = dg.AssetKey(["hardware_logs"])
READABLE = "every_log_readable"
VERIFIED = "every_log_verified"
INTEGRITIES = ("complete", "recovered", "unverified")

hardware_logs = dg.AssetSpec(
    HARDWARE_LOGS,
    group_name=HARDWARE,
    description="The folder data/hardware_logs: MCAP files and sqlite3 bags of the robot, by content.",
    kinds={"file"},
)


def logs_version(project: Project) -> tuple[str, dict[str, Any]]:
    """Digest of the logs that are complete, and what is noted of them in the history.

    A copy of a log changes nothing. Files that cannot be looked at are passed over: no other asset waits for logs.
    """

    logs, waiting = complete_logs(project.hardware_logs, project.log_digests)
    version = digest.of_json(sorted({log.question for log in logs}))
    return version, {"files": len(logs), "still being written": len(waiting)}


@dg.asset(
    key=TRIALS.key,
    deps=[HARDWARE_LOGS],
    group_name=HARDWARE,
    kinds={"parquet"},
    code_version=TRIALS.code_version(),
    check_specs=[
        dg.AssetCheckSpec(READABLE, asset=TRIALS.key, description="No log is refused."),
        dg.AssetCheckSpec(VERIFIED, asset=TRIALS.key, description="Every log has checksums, which hold."),
    ],
)
@plain_errors
def hardware_trials(context: dg.AssetExecutionContext):
    """Trials of the robot: damage reported, time regular, joints in the robot's order, values checked."""

    values = settings.read(PROJECT.settings("hardware_logs.yaml"), LogSettings)
    found = ingest_folder(PROJECT, TRIALS, values, context.log)
    manifest = found.manifest
    refused = [row.clip for row in manifest.judged if row.fate == "rejected"]
    integrity_of = {row.clip: row.numbers["integrity"] for row in manifest.judged}
    damaged = [
        f"{log} {integrity}" for log, integrity in integrity_of.items() if integrity in ("recovered", "unverified")
    ]
    checks = [_check(READABLE, refused, len(manifest.judged)), _check(VERIFIED, damaged, len(manifest.judged))]
    return dg.MaterializeResult(
        asset_key=TRIALS.key,
        value=manifest,
        metadata={**_metadata(manifest), "not looked at": "; ".join(found.passed_over) or "none"},
        check_results=checks,
        data_version=dg.DataVersion(manifest.digest),
        tags={FINGERPRINT_TAG: TRIALS.fingerprint(PROJECT), FAULTS_TAG: str(found.faults)},
    )


def trials_of(manifest: Manifest) -> Iterator[tuple[str, Path, dict[str, Any]]]:
    """Name, Parquet file (`pipeline.hardware_logs.read_trial`) and numbers of each trial that was ingested."""
    for entry in manifest.entries:
        yield entry.clip, PROJECT.store.blobs.path(entry.blob), entry.numbers


def _check(name: str, found: list[str], count: int) -> dg.AssetCheckResult:
    return dg.AssetCheckResult(
        asset_key=TRIALS.key,
        check_name=name,
        passed=not found,
        severity=dg.AssetCheckSeverity.WARN,
        metadata={"found": ", ".join(found) or f"{count} logs"},
    )


def _metadata(manifest: Manifest) -> dict[str, Any]:
    table = manifest.judged_table()
    fates = {name: sum(row.numbers["integrity"] == name for row in manifest.judged) for name in INTEGRITIES}
    trials = pd.DataFrame([{"trial": entry.clip, **entry.numbers} for entry in manifest.entries])
    of_logs = ["clip", "fate", "integrity", "messages", "seconds_out", "reasons"]
    columns = ["trial", "robot", "seconds", "policy_digest", "command_source", "simulated", "integrity"]
    return {
        "logs": len(manifest.judged),
        "trials": len(manifest.entries),
        "seconds": round(manifest.seconds("seconds_out"), 2),
        **{f"logs {name}": count for name, count in fates.items()},
        "logs refused": sum(row.fate == "rejected" for row in manifest.judged),
        "logs read": manifest.recomputed,
        "dagster/row_count": len(manifest.entries),
        "integrity of each log": table_of(table, of_logs),
        "what was made": table_of(trials, [*columns, "gaps", "gap_seconds", "message_hz"]),
    }
