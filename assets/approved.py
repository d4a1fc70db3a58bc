"""What was approved of the feedback from hardware, from outside the graph: an external asset per part, used by a stage.

A person stands between `curation_feedback`, which proposes, and these. So the graph has no cycle, nothing takes effect
unseen, and a change of weights makes nothing stale but KP5 and the database. Without `data/feedback/approved.yaml` all
parts are empty, and nothing of the hardware's is read. A part of that file that can't be used has a version of its
own, so that the asset that uses it is stale and fails with that reason; nothing else does.
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
"""Section of the approved changes -> name of its asset."""

SHARED_PARTS = ("selection",)
"""Sections that all robots share."""

BROKEN = "broken-"
"""What the version of a part that can't be used begins with."""

PAGE_TAG = "booster_lab/approved_on_page"
"""Tag of a materialization of curation_feedback, and of a run that renews its page: what is approved, as it shows."""

APPROVED = "What was approved of curation_feedback (data/feedback/approved.yaml)"
SAYS = {
    "selection": "most seconds of skills, for KP1",
    "augmentation": "perturbations of the clips of skills, for KP4",
    "weights": "factors on command cells, for KP5",
    "motors": "torque limits that the robot showed, for its model",
    "randomization": "ranges that training draws from",
}


def approved_key(section: str, robot: str | None) -> dg.AssetKey:
    """Key of the asset that a part is."""
    return key_of(PARTS[section], robot)


def approved_specs(robot: str | None) -> list[dg.AssetSpec]:
    """The external assets of a robot; None for those that all share."""
    sections = [name for name in PARTS if (name in SHARED_PARTS) == (robot is None)]
    return [external(PARTS[section], robot, f"{APPROVED}: {SAYS[section]}.", [PROPOSAL]) for section in sections]


def approved_part(project: Project, section: str, robot: str | None) -> tuple[Change, ...]:
    """The approved changes of a section for a robot. Raises PipelineError where they can't be used."""
    approvals = project.feedback.approvals()
    if section in approvals.faults:
        raise approvals.faults[section]
    return part_of(approvals.changes, section, None if section in SHARED_PARTS else robot)


def approval_metadata(part: Sequence[Change]) -> dict[str, Any]:
    """Approved changes for the page of an asset; empty without any."""
    return {"feedback": dg.MetadataValue.md(markdown_list(change.text() for change in part))} if part else {}


def approved_versions(project: Project) -> dict[dg.AssetKey, tuple[str, dict[str, Any]]]:
    """Version of each part, and what is noted of it in the history."""
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
    """Digest of what the page of curation_feedback shows of a person's answers."""
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
