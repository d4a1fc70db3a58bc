"""A project whose folder of hardware logs a test fills."""

import os
import shutil
import time
from pathlib import Path

import pytest

import assets.hardware
import assets.resources
import assets.sensors
from pipeline.hardware_logs import Storage, mcap_bytes
from pipeline.project import Project
from pipeline.robot import load_robot
from tests.factories.robot_logs import robot_log

LONG_AGO_S = 3_600.0


def log_project(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project of its own, without motions, logs or a store."""
    made = Project(tmp_path)
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots/t1").symlink_to(root / "robots/t1")
    made.hardware_logs.mkdir(parents=True)
    for path in (root / "data").glob("*.yaml"):
        shutil.copy(path, made.data)
    (made.data / "motions").mkdir()
    for module in (assets.hardware, assets.sensors, assets.resources):
        monkeypatch.setattr(module, "PROJECT", made)
    return made


def drop(project: Project, name: str, data: bytes, age_s: float = LONG_AGO_S) -> Path:
    """Put a file into the folder that was last written `age_s` ago."""
    path = project.hardware_logs / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    then = time.time() - age_s
    os.utime(path, (then, then))
    return path


def one_second_log() -> bytes:
    """A whole log of the T1 in chunks."""
    return mcap_bytes(robot_log(load_robot("t1"), 1.0), Storage(chunk_bytes=60_000))
