"""`manifest.json`: what a database is, what is in it, and what it may be used for."""

from collections import Counter
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


SEAL = "sha256"
"""Key of the manifest's digest of itself."""


def facts(rows: list[dict[str, Any]], robot: Robot, stages: Mapping[str, Any]) -> dict[str, Any]:
    """What the manifest says of the index's rows; `sealed` adds the files."""
    licences = sorted({entry["licence"] for entry in rows})
    worst = strictest(licences)
    return {
        "schema": SCHEMA,
        "robot": robot.name,
        "robot_digest": robot.digest,
        **frame_facts(robot),
        "clips": len(rows),
        "frames": sum(entry["frames"] for entry in rows),
        "seconds": round(sum(entry["seconds"] for entry in rows), 6),
        "seconds_by_skill": _seconds_by_skill(rows),
        "clips_by_source": dict(sorted(Counter(str(entry.get("source") or "unknown") for entry in rows).items())),
        "licence": {
            "strictest": worst.label,
            "allowed_use": worst.allowed_use,
            "licences": {licence: classify_licence(licence).label for licence in licences},
        },
        "stages": dict(stages),
    }


def frame_facts(robot: Robot) -> dict[str, Any]:
    """What the manifest says of all frames."""
    return {"frame_duration_s": 1.0 / FPS, "frame_columns": len(columns(robot))}


def sealed(folder: Path, head: Mapping[str, Any], written: Mapping[str, str]) -> dict[str, Any]:
    """The manifest: its facts, the digest of each file in `folder` but itself, and the digest of all that.

    Files whose digest `written` has by their name are not read.
    """
    names = sorted(path.name for path in folder.iterdir() if path.name != FILE)
    content = {**head, "files": {name: written.get(name) or digest.of_file(folder / name) for name in names}}
    return {**content, SEAL: seal_of(content)}


def seal_of(head: Mapping[str, Any]) -> str:
    """Digest of everything else that a manifest says."""
    return digest.of_json({key: value for key, value in head.items() if key != SEAL})


def broken_seal(head: Mapping[str, Any]) -> str | None:
    """What is wrong with the digest that a manifest carries of itself; None if nothing is."""
    if SEAL not in head:
        return f"carries no digest of itself ('{SEAL}')"
    try:
        holds = head[SEAL] == seal_of(head)
    except (ValueError, TypeError):  # a number that is not finite
        holds = False
    return None if holds else "was changed: its content is not the one that its own digest states"


def _seconds_by_skill(rows: list[dict[str, Any]]) -> dict[str, float]:
    seconds: dict[str, float] = {}
    for entry in rows:
        seconds[entry["skill"]] = seconds.get(entry["skill"], 0.0) + entry["seconds"]
    return {skill: round(value, 6) for skill, value in sorted(seconds.items())}
