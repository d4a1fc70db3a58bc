"""What was approved of the feedback from hardware, from outside the graph: an external asset a part, heeded by a stage.

A person stands between `curation_feedback`, which proposes, and these. So the graph has no cycle, nothing takes effect
unseen, and a change of weights makes nothing stale but KP5 and the database. Without `data/feedback/approved.yaml` all
parts are empty, and nothing of the hardware's is looked at.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import dagster as dg

from assets.project import DEFAULT_ROBOT, Project
from pipeline.batch import Manifest
from pipeline.feedback.approved import lineage, part_of, part_version, read_changes
from pipeline.feedback.change import Change
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import settings

PROPOSAL = dg.AssetKey(["curation_feedback"])

PARTS: dict[str, str] = {
    "selection": "approved_windows",
    "augmentation": "approved_variants",
    "weights": "approved_weights",
    "motors": "approved_limits",
    "randomization": "approved_randomization",
}
"""Section of the approved changes -> name of its asset."""

SHARED_PARTS = ("selection",)
"""Sections that all robots share."""

SAYS = {
    "selection": "seconds of skills, for KP1",
    "augmentation": "further playing speeds of skills, for KP4",
    "weights": "factors on command cells, for KP5",
    "motors": "torque limits that the robot showed, for its model",
    "randomization": "ranges that training draws from",
}


def approved_key(section: str, robot: str | None) -> dg.AssetKey:
    """Key of the asset that a part is."""
    name = PARTS[section]
    bare = section in SHARED_PARTS or robot in (None, DEFAULT_ROBOT)
    return dg.AssetKey([name]) if bare else dg.AssetKey([str(robot), name])


def approved_specs(robot: str | None) -> list[dg.AssetSpec]:
    """The external assets of a robot; None for those that all share."""
    sections = [name for name in PARTS if (name in SHARED_PARTS) == (robot is None)]
    return [
        dg.AssetSpec(
            approved_key(section, robot),
            deps=[PROPOSAL],
            group_name="field" if robot is None else f"{robot}_motions",
            description=f"What was approved of curation_feedback (data/feedback/approved.yaml): {SAYS[section]}.",
            kinds={"file"},
        )
        for section in sections
    ]


def approved_changes(project: Project) -> tuple[Change, ...]:
    """All approved changes, held against the rules. Raises SettingsError."""
    if not project.approved_feedback.is_file():
        return ()
    return read_changes(
        project.approved_feedback, settings.read(project.settings("feedback_rules.yaml"), FeedbackRules)
    )


def approved_part(project: Project, section: str, robot: str | None) -> tuple[Change, ...]:
    """The approved changes of a section for a robot."""
    return part_of(approved_changes(project), section, None if section in SHARED_PARTS else robot)


def noting(manifest: Manifest, part: Sequence[Change], section: str) -> Manifest:
    """The manifest, and in it the changes that took effect with the logs that they rest on; as it is without any."""
    return dataclasses.replace(manifest, settings={**manifest.settings, **lineage(part, section)})


def told(part: Sequence[Change]) -> dict[str, Any]:
    """What the page of an asset says of approved changes; nothing where there are none."""
    return {"feedback": dg.MetadataValue.md("\n".join(f"- {change.text()}" for change in part))} if part else {}


def approved_versions(project: Project) -> dict[dg.AssetKey, tuple[str, dict[str, Any]]]:
    """Version of each part, and what is noted of it in the history."""
    changes = approved_changes(project)
    found = {}
    for section in PARTS:
        for robot in (None,) if section in SHARED_PARTS else project.robots:
            part = part_of(changes, section, robot)
            logs = sorted({each.log for change in part for each in change.witnesses})
            facts: dict[str, Any] = {"changes": len(part)}
            if part:
                lines = "\n".join(f"- {change.text()}" for change in part)
                facts |= {"what": dg.MetadataValue.md(lines), "logs": ", ".join(logs)}
            found[approved_key(section, robot)] = (part_version(part), facts)
    return found
