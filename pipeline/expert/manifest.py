"""`manifest.json`: what a database is, what is in it, and what it may be used for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.expert.frames import FPS, columns
from pipeline.expert.licence import classify_licence, strictest
from pipeline.files import digest
from pipeline.robot import Robot

FILE = "manifest.json"

SCHEMA = "booster-lab expert database 1"
"""Raised when a reader of the old one could misread the new one."""


def build(folder: Path, rows: list[dict[str, Any]], robot: Robot, stages: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest of the files that lie in `folder` (all but itself) and of the index's rows."""
    licences = sorted({entry["licence"] for entry in rows})
    worst = strictest(licences)
    files = sorted(path for path in folder.iterdir() if path.name != FILE)
    return {
        "schema": SCHEMA,
        "robot": robot.name,
        "robot_digest": robot.digest,
        "frame_duration_s": 1.0 / FPS,
        "frame_columns": len(columns(robot)),
        "clips": len(rows),
        "frames": sum(entry["frames"] for entry in rows),
        "seconds": round(sum(entry["seconds"] for entry in rows), 6),
        "seconds_by_skill": _seconds_by_skill(rows),
        "licence": {
            "strictest": worst.label,
            "allowed_use": worst.allowed_use,
            "licences": {licence: classify_licence(licence).label for licence in licences},
        },
        "stages": dict(stages),
        "files": {path.name: digest.of_file(path) for path in files},
    }


def _seconds_by_skill(rows: list[dict[str, Any]]) -> dict[str, float]:
    seconds: dict[str, float] = {}
    for entry in rows:
        seconds[entry["skill"]] = seconds.get(entry["skill"], 0.0) + entry["seconds"]
    return {skill: round(value, 6) for skill, value in sorted(seconds.items())}
