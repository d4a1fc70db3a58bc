"""Work that is killed or that meets a full disk: what writes the project's files, each on a small set.

Each kind of work has a folder of its own. `prepare` makes what it starts from, `work` is what is interrupted, `check`
holds what must be true of the folder whenever it was, and gives the state that it is in.
"""

from __future__ import annotations

import logging
import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from assets.hardware import ingest_folder
from pipeline.actuators.adapted_robot import adapt, write_adapted_robot
from pipeline.actuators.settings import ActuatorSettings
from pipeline.batch import Manifest
from pipeline.errors import PipelineError
from pipeline.expert import DatabaseSettings, ExpertEntry, history, read_database, write_database
from pipeline.expert.training_bundle import write_training_bundle
from pipeline.feedback.approve import approve_proposal
from pipeline.feedback.change import proposal_digest
from pipeline.files import digest, settings
from pipeline.hardware_logs import LogSettings, Storage, mcap_bytes
from pipeline.project import Project
from pipeline.robot import load_robot
from tests.factories.feedback_project import feedback_project, propose_into, two_falls
from tests.factories.robot_clips import wandering
from tests.factories.robot_logs import robot_log
from tests.factories.trial_reports import proposal

ROOT = Path(__file__).resolve().parents[2]
LOG = logging.getLogger("interrupted")
FEW, MANY = 3, 5
"""Clips of the database before and after."""


@dataclass(frozen=True)
class Work:
    """One kind of work."""

    prepare: Callable[[Path], None]
    work: Callable[[Path], None]
    check: Callable[[Path], str]
    """`before`, `after`, or `between` where that is a state that may be. Raises AssertionError or PipelineError."""


def _database(folder: Path, clips: int) -> None:
    robot = load_robot("t1")
    entries = [
        ExpertEntry(
            clip=wandering(robot, seed=index).cut(0, 60, f"source/clip{index}"),
            weight=1.0,
            skill="walk",
            licence="CC0-1.0",
            numbers={"variant": "original"},
        )
        for index in range(clips)
    ]
    values = DatabaseSettings(max_lost_share=0.9, kept_versions=2)
    write_database(folder / "t1", entries, robot, stages={}, settings=values)


def _check_database(folder: Path) -> str:
    clips = len(read_database(folder / "t1").clips)
    assert clips in (FEW, MANY)
    for version in history.read_versions(folder / "t1"):
        read_database(version.folder)
    return "before" if clips == FEW else "after"


def _prepare_ingest(folder: Path) -> None:
    (folder / "robots").mkdir()
    (folder / "robots/t1").symlink_to(ROOT / "robots/t1")
    logs = folder / "data/hardware_logs"
    logs.mkdir(parents=True)
    for path in (ROOT / "data").glob("*.yaml"):
        shutil.copy(path, folder / "data")
    data = mcap_bytes(robot_log(load_robot("t1"), 0.5), Storage(chunk_bytes=60_000))
    for name, content in {"a": data, "b": b"no log at all" * 10, "c": data[: len(data) // 2]}.items():
        (logs / f"{name}.mcap").write_bytes(content)
        os.utime(logs / f"{name}.mcap", (time.time() - 3_600.0,) * 2)


def _ingest(folder: Path) -> None:
    project = Project(folder)
    values = settings.read(project.settings("hardware_logs.yaml"), LogSettings)
    ingested = ingest_folder(project, values, LOG)
    project.store.save("hardware_trials", ingested.manifest)
    if ingested.faults:  # the asset states them and is stale until there are none
        raise PipelineError(" ".join(_fault_texts(ingested.manifest)))


def _fault_texts(manifest: Manifest) -> list[str]:
    """Reasons of the logs that the machine kept us from reading."""
    texts = [reason["text"] for row in manifest.judged for reason in row.reasons]
    return [text for text in texts if "No space left" in text]


def _check_ingest(folder: Path) -> str:
    store = Project(folder).store
    assert all(store.own_blobs.is_whole(path.name) for path in (store.root / "blobs").glob("*/[0-9a-f]*"))
    if not store.manifest_path("hardware_trials").is_file():
        return "before"
    manifest = store.load("hardware_trials")
    assert store.holds_blobs_of("hardware_trials")
    if _fault_texts(manifest):
        return "between"
    assert [row.fate for row in manifest.judged] == ["accepted", "rejected", "accepted"]
    return "after"


def _prepare_approval(folder: Path) -> None:
    propose_into(feedback_project(ROOT, folder), *two_falls())


def _approve(folder: Path) -> None:
    approve_proposal(Project(folder).feedback, proposal_digest(proposal(*two_falls()).changes), "a person")


def _check_approval(folder: Path) -> str:
    approvals = Project(folder).feedback.approvals()
    assert approvals.readable and not approvals.faults
    assert len(approvals.changes) in (0, 5)
    return "after" if approvals.changes else "before"


def _prepare_bundle(folder: Path) -> None:
    robot = load_robot("t1")
    actuators = adapt(robot, [], settings.read(ROOT / "data" / "actuators.yaml", ActuatorSettings))
    write_adapted_robot(folder / "robot", ROOT / "robots" / robot.name, actuators)
    _database(folder, FEW)


def _write_bundle(folder: Path) -> None:
    write_training_bundle(folder / "bundle", folder / "t1", folder / "robot")


def _check_bundle(folder: Path) -> str:
    """The head of a bundle is written last: one with a head is whole."""
    head = folder / "bundle/bundle.json"
    if not head.is_file():
        return "before"
    files = settings.read_yaml(head)["files"]
    assert all(digest.of_file(folder / "bundle" / name) == content for name, content in files.items())
    return "after"


WORKS = {
    "database swap": Work(
        lambda folder: _database(folder, FEW), lambda folder: _database(folder, MANY), _check_database
    ),
    "ingest": Work(_prepare_ingest, _ingest, _check_ingest),
    "approval": Work(_prepare_approval, _approve, _check_approval),
    "training start": Work(_prepare_bundle, _write_bundle, _check_bundle),
}


def run(name: str, folder: Path) -> None:
    """Do the work; a refusal of the disk is a sentence and no fault."""
    WORKS[name].work(folder)


def refused(name: str, folder: Path) -> str:
    """Do the work; the sentence with which it was refused, empty where it was done."""
    try:
        run(name, folder)
    except PipelineError as error:
        return str(error)
    return ""
