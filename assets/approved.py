"""Approved feedback from hardware: one external asset per section of `data/feedback/approved.yaml`.

`curation_feedback` proposes changes and a person approves them, so the graph has no cycle and no change takes effect
without review. Each section is an input of one stage: approved weights make only KP5 and the database stale. Without
the file, all sections are empty and no hardware data has an effect. An invalid section has a version of its own, so
that the asset that uses it becomes stale and fails with the reason; other assets are not affected.
"""

from collections.abc import Sequence
from typing import Any

import dagster as dg

from assets.plan import external, key_of
from pipeline.errors import PipelineError
from pipeline.feedback.approved import Approvals, part_of, part_version
from pipeline.feedback.change import Change
from pipeline.files import digest, settings
from pipeline.files.shown_text import markdown_list
from pipeline.project import Project

PROPOSAL = dg.AssetKey(["curation_feedback"])

PARTS: dict[str, str] = {
    "selection": "approved_windows",
    "augmentation": "approved_variants",
    "weights": "approved_weights",
    "motors": "approved_limits",
    "randomization": "approved_randomization",
}
"""Section of the approved changes -> name of its external asset."""

SHARED_PARTS = ("selection",)
"""Sections that all robots share."""

BROKEN = "broken-"
"""Prefix of the version of an invalid section."""

PAGE_TAG = "booster_lab/approved_on_page"
"""Tag of a materialization of curation_feedback and of a run that renews its page: digest of the shown answers."""

APPROVED = "Approved changes of curation_feedback (data/feedback/approved.yaml)"
CONTENTS = {
    "selection": "limits on the seconds per skill, for KP1",
    "augmentation": "additional perturbed variants of the clips of a skill, for KP4",
    "weights": "factors on the weights of command cells, for KP5",
    "motors": "joint torque limits observed on the robot, for its adapted model",
    "randomization": "domain randomization ranges, for training",
}


def approved_key(section: str, robot: str | None) -> dg.AssetKey:
    """Key of the external asset of a section."""
    return key_of(PARTS[section], robot)


def approved_specs(robot: str | None) -> list[dg.AssetSpec]:
    """The external assets of a robot; with None, those that all robots share."""
    sections = [name for name in PARTS if (name in SHARED_PARTS) == (robot is None)]
    return [external(PARTS[section], robot, f"{APPROVED}: {CONTENTS[section]}.", [PROPOSAL]) for section in sections]


def approved_part(project: Project, section: str, robot: str | None) -> tuple[Change, ...]:
    """The approved changes of a section for a robot. Raises PipelineError if the section is invalid."""
    approvals = project.feedback.approvals()
    if section in approvals.faults:
        raise approvals.faults[section]
    return part_of(approvals.changes, section, None if section in SHARED_PARTS else robot)


def approval_metadata(part: Sequence[Change]) -> dict[str, Any]:
    """Metadata row with the approved changes; empty if there are none."""
    return {"feedback": dg.MetadataValue.md(markdown_list(change.text() for change in part))} if part else {}


def approved_versions(project: Project) -> dict[dg.AssetKey, tuple[str, dict[str, Any]]]:
    """Version of each section's asset, and the metadata that Dagster's history records with it."""
    approvals = project.feedback.approvals()
    found = {}
    for section in PARTS:
        for robot in (None,) if section in SHARED_PARTS else project.robots:
            fault = approvals.faults.get(section)
            part = part_of(approvals.changes, section, robot)
            version = part_version(part) if fault is None else f"{BROKEN}{digest.of_json(str(fault))[:16]}"
            found[approved_key(section, robot)] = (version, _facts(part, fault))
    return found


def shown_state(approvals: Approvals, declined: Sequence[Change]) -> str:
    """Digest of the answers (approved, declined, faults) that the page of curation_feedback shows."""
    faults = {section: str(fault) for section, fault in approvals.faults.items()}
    return digest.of_json([settings.plain(approvals.changes), settings.plain(declined), faults])[:16]


def _facts(part: Sequence[Change], fault: PipelineError | None) -> dict[str, Any]:
    if fault is not None:
        return {"can't be used": str(fault)}
    facts: dict[str, Any] = {"changes": len(part)}
    if part:
        logs = sorted({each.log for change in part for each in change.witnesses})
        lines = markdown_list(change.text() for change in part)
        facts |= {"what": dg.MetadataValue.md(lines), "logs": ", ".join(logs)}
    return facts
