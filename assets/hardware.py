"""Robot logs: the folder `data/hardware_logs`, and the trials that are extracted from the logs.

Results of logs that were read before come from the store's cache. For a refused log, a text file in the quarantine
folder has the reason.
"""

import logging
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dagster as dg
import pandas as pd

from assets.plan import TRIALS, digest_of_robots, external
from assets.report import asset_of, check_result, result_of, table_of
from pipeline.batch import Entry, Judged, Manifest
from pipeline.clips.outcome import Reason
from pipeline.errors import PipelineError
from pipeline.files import digest, settings
from pipeline.hardware_logs import LogError, LogSettings, ingest, layouts
from pipeline.hardware_logs.log_folder import (
    QUARANTINE,
    LogFile,
    closed_folders,
    complete_logs,
    note_refusals,
    packed_files,
    without_copies,
)
from pipeline.project import PROJECT, Project

LogResult = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class IngestedLogs:
    """Result of ingesting all logs."""

    manifest: Manifest
    faults: int
    """Number of logs that could not be read for a reason outside the log; the next run tries again."""
    passed_over: tuple[str, ...]
    """A message for each file that is not a complete log, or is a copy."""


def ingest_folder(project: Project, values: LogSettings, log: logging.Logger) -> IngestedLogs:
    """Ingest all logs of `data/hardware_logs`. A fault of one log does not stop the others."""
    folder = project.hardware_logs
    shutil.rmtree(project.store.root / "ingest", ignore_errors=True)  # left by a killed run
    files, waiting = complete_logs(folder, project.log_digests)
    files, copies = without_copies(files, _names_before(project))
    version = digest.of_json([TRIALS.name, TRIALS.code_version(), settings.plain(values), digest_of_robots(project)])
    answers: dict[str, LogResult] = {}
    read, faults = 0, 0
    for file in files:
        key = digest.of_json([version, file.name, file.question])
        answer = project.store.recall(key, TRIALS.name)
        if answer is None:
            log.info(f"'{file.name}' is read")
            answer, is_fault = _read_log(project, file, values)
            read, faults = read + 1, faults + is_fault
            if not is_fault:
                project.store.remember(key, answer, TRIALS.name)
        answers[file.name] = answer
    refused = {name: answer["refused"] for name, answer in answers.items() if answer["refused"]}
    unwritten = note_refusals(folder / QUARANTINE, refused)
    for sentence in unwritten:
        log.warning(sentence)
    passed_over = [f"{path.relative_to(folder)} is still being written, or can't be read." for path in waiting] + copies
    passed_over += [
        *unwritten,
        *(f"{path.relative_to(folder)} can't be opened." for path in closed_folders(folder)),
    ]
    passed_over += [
        f"{path.relative_to(folder)} is an archive or a ROS 1 bag: unpack or convert it."
        for path in packed_files(folder)
    ]
    return IngestedLogs(manifest=_manifest(files, answers, values, read), faults=faults, passed_over=tuple(passed_over))


def _names_before(project: Project) -> dict[str, str]:
    """Content digest -> name of the logs in the last manifest."""
    try:
        before = project.store.load(TRIALS.key.to_user_string())
    except PipelineError:
        return {}
    return {row.numbers["question"]: row.clip for row in before.judged}


def _read_log(project: Project, file: LogFile, values: LogSettings) -> tuple[LogResult, bool]:
    """Read a log. Returns its result, and whether a fault outside the log (disk, memory) prevented it."""
    aside: Path | None = None
    try:
        root = project.store.root / "ingest"
        root.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(dir=root))
        robots = [project.robot(robot) for robot in project.robots]
        made = ingest(file.path, file.name, aside, layouts=layouts(robots), settings=values, sidecar=file.sidecar)
        pieces = [
            {"clip": each.name, "blob": project.store.own_blobs.take(each.path), "numbers": each.numbers}
            for each in made.trials
        ]
        facts = {"integrity": made.integrity, "messages": made.messages, "notes": list(made.notes)}
        return {"pieces": pieces, **facts, "refused": ""}, False
    except LogError as error:
        where = f" (at byte {error.offset}, {error.recovered} messages read)."
        return _refused(f"{file.name}: {error.reason}{where}", error.recovered), False
    except (PipelineError, OSError) as error:
        return _refused(f"{file.name}: {' '.join(str(error).split())}", 0), True
    except MemoryError:
        return _refused(f"{file.name}: there is not enough memory to read it; it is tried again.", 0), True
    finally:
        if aside is not None:
            shutil.rmtree(aside, ignore_errors=True)


def _refused(sentence: str, messages: int) -> LogResult:
    return {"pieces": [], "integrity": "", "messages": messages, "notes": [], "refused": sentence}


def _manifest(files: list[LogFile], answers: Mapping[str, LogResult], values: LogSettings, read: int) -> Manifest:
    stated = settings.plain(values)
    record = ({"stage": TRIALS.name, "version": TRIALS.code_version(), "settings": digest.of_json(stated)},)
    entries, judged = [], []
    for file in files:
        answer = answers[file.name]
        about = {"log": file.name, "log_sha256": file.content}
        for piece in answer["pieces"]:
            numbers = {**piece["numbers"], **about}
            entries.append(Entry(clip=piece["clip"], blob=piece["blob"], numbers=numbers, record=record))
        seconds = sum(piece["numbers"]["seconds"] for piece in answer["pieces"])
        judged.append(
            Judged(
                clip=file.name,
                pieces=tuple(piece["clip"] for piece in answer["pieces"]),
                reasons=tuple(each.to_dict() for each in _reasons(answer)),
                numbers={
                    **about,
                    "question": file.question,
                    "integrity": answer["integrity"],
                    "messages": answer["messages"],
                    "seconds_in": seconds,
                    "seconds_out": seconds,
                },
            )
        )
    return Manifest(
        stage=TRIALS.name,
        entries=tuple(entries),
        judged=tuple(judged),
        settings={digest.of_json(stated): {"stage": TRIALS.name, **stated}},
        recomputed=read,
    )


def _reasons(answer: LogResult) -> list[Reason]:
    if answer["refused"]:
        return [Reason(code="refused", text=answer["refused"], effect="rejected")]
    code = answer["integrity"] if answer["integrity"] != "complete" else "noted"
    return [
        Reason(code=code if number == 0 else "noted", text=text, effect="noted")
        for number, text in enumerate(answer["notes"])
    ]


HARDWARE_LOGS = dg.AssetKey(["hardware_logs"])
READABLE = "every_log_readable"
VERIFIED = "every_log_verified"
INTEGRITIES = ("complete", "recovered", "unverified")

FOLDER = "The folder data/hardware_logs: MCAP files and sqlite3 bags of the robot, versioned by content."
hardware_logs = external("hardware_logs", None, FOLDER)


def logs_version(project: Project) -> tuple[str, dict[str, Any]]:
    """Digest of the complete logs, and the metadata that Dagster's history records with it.

    A copy of a log does not change the digest. Unreadable files are skipped, so that they do not block other assets.
    """
    logs, waiting = complete_logs(project.hardware_logs, project.log_digests)
    version = digest.of_json(sorted({log.question for log in logs}))
    return version, {"files": len(logs), "still being written": len(waiting)}


@asset_of(
    TRIALS,
    "parquet",
    deps=[HARDWARE_LOGS],
    checks={READABLE: "No log is refused.", VERIFIED: "Every log has checksums, and they match."},
)
def hardware_trials(context: dg.AssetExecutionContext):
    """Trials from the robot logs: resampled to a regular rate, joints in the robot's order, values checked.

    Damage of a log is reported with its integrity: complete, recovered or unverified.
    """
    values = PROJECT.read("hardware_logs.yaml", LogSettings)
    found = ingest_folder(PROJECT, values, context.log)
    manifest = found.manifest
    refused = [row.clip for row in manifest.judged if row.fate == "rejected"]
    integrity_of = {row.clip: row.numbers["integrity"] for row in manifest.judged}
    damaged = [f"{log} {word}" for log, word in integrity_of.items() if word in ("recovered", "unverified")]
    checks = [
        check_result(TRIALS, name, not logs, ", ".join(logs) or f"{len(manifest.judged)} logs")
        for name, logs in ((READABLE, refused), (VERIFIED, damaged))
    ]
    metadata = {**_metadata(manifest), "files that were not read": "; ".join(found.passed_over) or "none"}
    return result_of(TRIALS, manifest, metadata, checks, faults=found.faults)


def trials_of(manifest: Manifest) -> Iterator[tuple[str, Path, dict[str, Any]]]:
    """Yield name, Parquet file (`pipeline.hardware_logs.read_trial`) and numbers of each ingested trial."""
    for entry in manifest.entries:
        yield entry.clip, PROJECT.store.own_blobs.path(entry.blob), entry.numbers


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
        "logs read in this run": manifest.recomputed,
        "dagster/row_count": len(manifest.entries),
        "integrity of each log": table_of(table, of_logs),
        "trials from all logs": table_of(trials, [*columns, "gaps", "gap_seconds", "message_hz"]),
    }
