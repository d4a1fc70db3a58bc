"""The file of approved changes, with one entry per section, and the effect of each section.

`data/feedback/proposed.yaml` has the same format, so copying it approves the whole proposal. An entry names the
reviewed proposal and the digest of its own changes; after an edit by hand, the digest must be updated. Each section is
checked against the rules separately: an invalid section does not affect the others.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pipeline.augment import AugmentSettings, Strengths
from pipeline.batch import Manifest
from pipeline.errors import PipelineError, SettingsError
from pipeline.feedback.change import (
    SECTIONS,
    Change,
    ChangeError,
    change_key,
    check_bounds,
    neutral,
    perturbation_of,
    proposal_digest,
)
from pipeline.feedback.rules import TIME_SCALE, FeedbackRules
from pipeline.files import atomic, digest, settings
from pipeline.selection.curation import Curation

EMPTY = "none"
"""Version of a section without changes."""
LINEAGE = "feedback on "
"""Prefix of the stage name under which a manifest holds the applied changes; the section follows."""

HEAD = {
    "proposed": "# Changes proposed by the rules from the failures in data/hardware_logs. To approve all of them, copy "
    "this file to\n# approved.yaml or run the job approve_feedback. Written by the asset curation_feedback.\n",
    "approved": "# Approved changes and the logs that support them. To revoke a section, delete its entry or run the "
    "job\n# take_back_feedback. To revoke all, delete the file.\n",
    "declined": "# Changes that a person declined on the curator's page. They are not pending again as long as the "
    "same logs\n# support them. To make a section pending again, delete its entry.\n",
}


@dataclass(frozen=True, kw_only=True)
class SectionApproval:
    """Changes of one section that were approved together."""

    section: str
    proposal: str
    """Digest of the reviewed proposal."""
    by: str = ""
    """Name of the person who approved them; empty in a proposal."""
    digest: str
    """Digest of these changes."""
    changes: tuple[Change, ...]


@dataclass(frozen=True, kw_only=True)
class ApprovalFile:
    """Format of `data/feedback/approved.yaml`, `proposed.yaml` and `declined.yaml`."""

    approvals: tuple[SectionApproval, ...]


@dataclass(frozen=True, kw_only=True)
class Approvals:
    """Answers read from a file."""

    entries: tuple[SectionApproval, ...] = ()
    """Entries of the file; none if it is unreadable."""
    faults: Mapping[str, PipelineError] = field(default_factory=dict)
    """Invalid section -> why it can't be used."""

    @property
    def changes(self) -> tuple[Change, ...]:
        """The changes of all valid sections."""
        return tuple(each for entry in self.entries if entry.section not in self.faults for each in entry.changes)

    @property
    def readable(self) -> bool:
        """Whether the file could be read, even if some sections are invalid."""
        return bool(self.entries) or not self.faults


def read_approvals(path: Path, rules: FeedbackRules) -> Approvals:
    """Read a file of approvals; empty if it does not exist. Faults are reported in the result, not raised."""
    if not path.is_file():
        return Approvals()
    try:
        entries = settings.read(path, ApprovalFile).approvals
        for place, entry in enumerate(entries):
            named = (entry.section, *(each.section for each in entry.changes))
            unknown = [name for name in named if name not in SECTIONS or name != entry.section]
            if unknown:
                problem = f"approvals[{place}] of '{entry.section}' has the section '{unknown[0]}'"
                raise SettingsError(path, f"{problem}, there are: {', '.join(SECTIONS)}.")
    except (SettingsError, OSError) as error:
        what = str(error) if isinstance(error, SettingsError) else f"{path}: {error.strerror}."
        answer = "decline" if path.stem == "declined" else "approve"
        fault = PipelineError(f"{what} Mend it, or delete it and {answer} again: without it nothing is {answer}d.")
        return Approvals(faults=dict.fromkeys(SECTIONS, fault))
    faults = {section: _fault(path, section, entries, rules) for section in SECTIONS}
    return Approvals(entries=entries, faults={section: fault for section, fault in faults.items() if fault})


def _fault(path: Path, section: str, entries: Sequence[SectionApproval], rules: FeedbackRules) -> SettingsError | None:
    """Why a section is invalid, and how to repair it; None if it is valid."""
    own = [(place, entry) for place, entry in enumerate(entries) if entry.section == section]
    for place, entry in own:
        found = proposal_digest(entry.changes)
        if found != entry.digest:
            return SettingsError(
                path,
                f"approvals[{place}], '{section}': its changes do not have the digest '{entry.digest}' but '{found}'.",
                f"If you changed them on purpose, set that digest; else {_remedy(section)}",
            )
    try:
        check_bounds([change for _, entry in own for change in entry.changes], rules)
    except ChangeError as error:
        where = ", ".join(f"approvals[{place}]" for place, _ in own)
        return SettingsError(path, f"{where}: {error}.", _remedy(section).capitalize())
    return None


def _remedy(section: str) -> str:
    return (
        f"approve '{section}' of the current proposal again (job approve_feedback), or revoke it (job "
        f"take_back_feedback, or delete the entry)."
    )


def entries_of(changes: Sequence[Change], proposal: str, by: str = "") -> tuple[SectionApproval, ...]:
    """Group changes into entries, one per section."""
    return tuple(
        SectionApproval(section=section, proposal=proposal, by=by, digest=proposal_digest(own), changes=own)
        for section in SECTIONS
        if (own := tuple(each for each in changes if each.section == section))
    )


def merged(
    earlier: Sequence[SectionApproval], new: Sequence[SectionApproval], *, whole: bool
) -> tuple[SectionApproval, ...]:
    """Merge new approvals into earlier ones; sections without a new approval stay as they are.

    Args:
        earlier: entries of the file
        new: entries to add
        whole: whether a new entry replaces its whole section; else it replaces single changes (`change_key`)
    """
    keys = {change_key(change) for entry in new for change in entry.changes}
    sections = {entry.section for entry in new}
    kept = []
    for entry in earlier:
        if entry.section not in sections:
            kept.append(entry)
            continue
        left = () if whole else tuple(each for each in entry.changes if change_key(each) not in keys)
        if left:
            kept.append(dataclasses.replace(entry, changes=left, digest=proposal_digest(left)))
    order = list(SECTIONS)
    return tuple(sorted((*kept, *new), key=lambda entry: order.index(entry.section)))


def write_entries(path: Path, entries: Sequence[SectionApproval], *, head: str = "approved") -> None:
    """Write a file of approvals or a proposal; remove it if there are no entries. `head` is a key of `HEAD`."""
    if not entries:
        path.unlink(missing_ok=True)
        return
    rows = []
    for entry in entries:
        by = {"by": entry.by} if entry.by else {}
        facts = {"section": entry.section, "proposal": entry.proposal, **by, "digest": entry.digest}
        rows.append({**facts, "changes": settings.plain(entry.changes)})
    text = yaml.safe_dump({"approvals": rows}, sort_keys=False, allow_unicode=True, width=120)
    atomic.write_text(path, HEAD[head] + text)


def part_of(changes: Sequence[Change], section: str, robot: str | None) -> tuple[Change, ...]:
    """The changes of a section for a robot, sorted; with None, those of all robots."""
    own = [each for each in changes if each.section == section and robot in (None, each.robot)]
    return tuple(sorted(own, key=lambda each: (each.section, each.robot, each.what)))


def part_version(part: Sequence[Change]) -> str:
    """Version of the changes of a section: a digest, or `EMPTY` without changes."""
    return digest.of_json(settings.plain(part)) if part else EMPTY


def lineage(part: Sequence[Change], section: str) -> dict[str, Any]:
    """Entry for the settings of a manifest: the applied changes with the logs that support them, by digest."""
    if not part:
        return {}
    return {part_version(part): {"stage": f"{LINEAGE}{section}", "changes": settings.plain(part)}}


def with_applied_changes(manifest: Manifest, part: Sequence[Change], section: str) -> Manifest:
    """Record the applied changes and their logs in the settings of a manifest; unchanged without changes."""
    return dataclasses.replace(manifest, settings={**manifest.settings, **lineage(part, section)})


def applied_versions(stages: Mapping[str, Any]) -> dict[str, str]:
    """Section -> version of the changes that were applied in a manifest with these stages."""
    named = {version: str(facts.get("stage", "")) for version, facts in stages.items()}
    return {stage.removeprefix(LINEAGE): version for version, stage in named.items() if stage.startswith(LINEAGE)}


def with_raised_limits(curation: Curation, changes: Sequence[Change]) -> Curation:
    """Raise the limits on the seconds of some skills. A skill without a limit is not affected."""
    factors: dict[str, float] = {}
    for change in changes:  # all robots share the windows, so the largest factor of any robot counts
        factors[change.what] = max(factors.get(change.what, 1.0), change.value)
    most = {skill: seconds * factors.get(skill, 1.0) for skill, seconds in curation.most_seconds.items()}
    return dataclasses.replace(curation, most_seconds=most)


def further_variants(changes: Sequence[Change], settings: AugmentSettings) -> dict[str, AugmentSettings]:
    """Skill -> settings that make only its additional variants, without those that all clips get."""
    found: dict[str, AugmentSettings] = {}
    none = dataclasses.replace(settings, time_scales=(), perturbations=Strengths())
    for change in changes:
        kind, skill = perturbation_of(change.what)
        own = found.get(skill, none)
        more = _with_speeds(own, change.value, settings) if kind == TIME_SCALE else _with(own, kind, change, settings)
        if more != own:
            found[skill] = more
    return found


def _with_speeds(own: AugmentSettings, width: float, settings: AugmentSettings) -> AugmentSettings:
    scales = tuple(round(1.0 + sign * width, 6) for sign in (-1.0, 1.0))
    new = tuple(scale for scale in scales if scale != 1.0 and scale not in settings.time_scales)
    return dataclasses.replace(own, time_scales=(*own.time_scales, *new))


def _with(own: AugmentSettings, kind: str, change: Change, settings: AugmentSettings) -> AugmentSettings:
    if change.value == neutral(kind) or change.value in getattr(settings.perturbations, kind):
        return own
    strengths = {kind: (*getattr(own.perturbations, kind), change.value)}
    return dataclasses.replace(own, perturbations=dataclasses.replace(own.perturbations, **strengths))
