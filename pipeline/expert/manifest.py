"""`manifest.json`: description, content and allowed use of a database."""

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
"""Version of the format, incremented when older readers could misread a database."""


SEAL = "sha256"
"""Key of the manifest's digest of itself."""


def facts(rows: list[dict[str, Any]], robot: Robot, stages: Mapping[str, Any]) -> dict[str, Any]:
    """Manifest entries computed from the index's rows; `sealed` adds the files."""
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
    """Manifest entries about the frames."""
    return {"frame_duration_s": 1.0 / FPS, "frame_columns": len(columns(robot))}


def sealed(folder: Path, head: Mapping[str, Any], written: Mapping[str, str]) -> dict[str, Any]:
    """The manifest: `head`, the digest of each other file in `folder`, and the digest of all that.

    Files whose digest is in `written` (name -> digest) are not read.
    """
    names = sorted(path.name for path in folder.iterdir() if path.name != FILE)
    content = {**head, "files": {name: written.get(name) or digest.of_file(folder / name) for name in names}}
    return {**content, SEAL: seal_of(content)}


def seal_of(head: Mapping[str, Any]) -> str:
    """Digest of a manifest without its own digest."""
    return digest.of_json({key: value for key, value in head.items() if key != SEAL})


def broken_seal(head: Mapping[str, Any]) -> str | None:
    """Error in the manifest's own digest; None if it is correct."""
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
