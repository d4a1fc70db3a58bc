"""Ingest a log file: read it, report damage, assign the robot, resample, check plausibility, write trials."""

import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.files import digest
from pipeline.hardware_logs import missed_bars
from pipeline.hardware_logs.bag_reader import BagReader
from pipeline.hardware_logs.log_facts import FactsError, StatedFacts, stated_facts
from pipeline.hardware_logs.log_report import LogReport, LogSettings, layouts
from pipeline.hardware_logs.mcap_reader import McapReader
from pipeline.hardware_logs.message_flow import MessageFlow
from pipeline.hardware_logs.regular import OpenTrial, TrialFiles
from pipeline.hardware_logs.robot_log import METADATA
from pipeline.hardware_logs.trial import Trial, read_trial
from pipeline.robot import Robot

SUFFIXES = {".mcap": McapReader, ".db3": BagReader}
"""File suffix -> reader."""


@dataclass(frozen=True, kw_only=True)
class IngestedTrial:
    """A trial's file and its row in the table of trials."""

    name: str
    path: Path
    numbers: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Ingested:
    """Result of ingesting a log."""

    trials: tuple[IngestedTrial, ...]
    integrity: str
    notes: tuple[str, ...]
    messages: int


def ingest(
    path: Path,
    name: str,
    folder: Path,
    *,
    layouts: Mapping[int, tuple[Robot, ...]],
    settings: LogSettings,
    sidecar: Path | None = None,
) -> Ingested:
    """Read a log and write its trials into a folder, in bounded memory.

    Args:
        path: `.mcap` or `.db3`
        name: name of the log's trials
        folder: output folder of the Parquet files; nothing is left there if the log is rejected
        layouts: robots by number of joints
        settings: thresholds of the ingest
        sidecar: the YAML file next to the log, if there is one

    Raises LogError with one sentence for a rejected log.
    """
    if path.suffix not in SUFFIXES:
        problem = f"not a log: its suffix is '{path.suffix}'"
        raise LogReport(path).refuse(problem, f"There are: {', '.join(SUFFIXES)}.")
    known: dict[str, str] | None = None
    while True:
        report = LogReport(path)
        source = SUFFIXES[path.suffix](path, report)
        if known is not None:
            source.metadata[METADATA] = known
        made = _read(source, name, folder, layouts, settings, sidecar)
        if made is not None:
            return made
        known = source.metadata[METADATA]  # it must be known before the first message, but came after it


def read_log(path: Path, robots: Iterable[Robot], settings: LogSettings) -> list[Trial]:
    """Read the trials of a log. Raises LogError for a rejected log."""
    with tempfile.TemporaryDirectory(prefix="booster-lab-log-") as folder:
        made = ingest(path, path.stem, Path(folder), layouts=layouts(robots), settings=settings)
        return [read_trial(each.path) for each in made.trials]


def _read(
    source: McapReader | BagReader,
    name: str,
    folder: Path,
    layouts: Mapping[int, tuple[Robot, ...]],
    settings: LogSettings,
    sidecar: Path | None,
) -> Ingested | None:
    """One pass over a log; None if its metadata differ from those assumed at the start. Raises LogError."""
    path, report = source.path, source.report
    with TrialFiles(folder) as files:
        flow = MessageFlow(source, report, files, layouts, settings, lambda: _facts(source, report, sidecar))
        flow.run()
        if METADATA in source.contradicted:
            raise report.refuse(f"two of its metadata records '{METADATA}' contradict each other")
        stated = _facts(source, report, sidecar)
        if flow.stated is not None and flow.stated != stated:
            return None
        robot = _robot(flow, stated, report)
        missed, doubts = _missed(stated, robot, len(files.trials))
        notes = (*_notes(flow, stated, report), *doubts)
        content = digest.of_file(path)
        names = [name if number == 1 else f"{name}+{number}" for number in range(1, len(files.trials) + 1)]
        heads = [
            {**_head(each, trial, robot, stated, report, notes, content, settings), **missed}
            for each, trial in zip(names, files.trials, strict=True)
        ]
        paths = files.finish(heads)
    trials = tuple(
        IngestedTrial(name=each, path=where, numbers=_numbers(head, trial))
        for each, where, head, trial in zip(names, paths, heads, files.trials, strict=True)
    )
    return Ingested(trials=trials, integrity=report.integrity, notes=notes, messages=report.total)


def _facts(source: McapReader | BagReader, report: LogReport, sidecar: Path | None) -> StatedFacts:
    try:
        return stated_facts(source.metadata.get(METADATA), sidecar)
    except FactsError as error:
        raise report.refuse(str(error)) from error


def _robot(flow: MessageFlow, stated: StatedFacts, report: LogReport) -> Robot:
    """The robot, from the number of joints; raises LogError if the metadata contradict it."""
    robot = flow.robot
    if robot is None:
        raise report.refuse(flow.why_nothing())
    if stated.facts.robot and stated.facts.robot != robot.name:
        joints = len(robot.joint_names)
        raise report.refuse(
            f"it is stated to be of '{stated.facts.robot}', but {joints} joints are those of '{robot.name}'"
        )
    if not flow.files.trials:
        raise report.refuse(f"it has no {flow.settings.time.min_s:g} s of /low_state in a row")
    return robot


def _notes(flow: MessageFlow, stated: StatedFacts, report: LogReport) -> tuple[str, ...]:
    notes = [*stated.remarks, *report.remarks, *flow.remarks()]
    if report.losses or report.integrity == "unverified":
        notes.insert(0, report.sentence())
    return tuple(notes)


def _missed(stated: StatedFacts, robot: Robot, pieces: int) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Trusted missed bars for the trial's metadata, and messages about the others."""
    missed, doubts = missed_bars.trusted_bars(stated.facts, robot.joint_names)
    if missed and pieces > 1:
        return {}, (f"in which of its {pieces} trials it missed its bars is not known: they are left out.",)
    return {"missed": [asdict(each) for each in missed]} if missed else {}, doubts


def _head(
    name: str,
    trial: OpenTrial,
    robot: Robot,
    stated: StatedFacts,
    report: LogReport,
    notes: tuple[str, ...],
    content: str,
    settings: LogSettings,
) -> dict[str, Any]:
    """All fields of a `Trial` that are not arrays."""
    assert trial.made is not None
    return {
        "name": name,
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "policy_digest": stated.facts.policy_digest,
        "command_source": trial.command_source,
        "simulated": stated.facts.simulated,
        "integrity": report.integrity,
        "rate_hz": settings.time.rate_hz,
        "start_ns": trial.made.start_ns,
        "log_digest": content,
        "notes": list(notes),
        "events": [vars(event) for event in trial.events],
        "gaps": [vars(gap) for gap in trial.made.gaps],
    }


def _numbers(head: dict[str, Any], trial: OpenTrial) -> dict[str, Any]:
    assert trial.made is not None
    made = trial.made
    kept = ("robot", "policy_digest", "command_source", "simulated", "integrity", "rate_hz", "start_ns", "log_digest")
    return {
        **{key: head[key] for key in kept},
        "seconds": round(trial.samples / head["rate_hz"], 6),
        "gaps": len(made.gaps),
        "gap_seconds": round(sum(gap.stop_s - gap.start_s for gap in made.gaps), 6),
        "message_hz": round(made.message_hz(head["rate_hz"]), 3),
    }
