"""The file of approved changes: an entry a section, each checked against the rules by itself, and what each part feeds.

`data/feedback/proposed.yaml` has the same form, so that copying it is approving all of it. An entry names the proposal
that was reviewed and has a digest of its own changes: one that was edited by hand must state its own. A fault in one
section leaves the others as they are.
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
    check_bounds,
    neutral,
    perturbation_of,
    place_of,
    proposal_digest,
)
from pipeline.feedback.rules import TIME_SCALE, FeedbackRules
from pipeline.files import atomic, digest, settings
from pipeline.selection.curation import Curation

EMPTY = "none"
"""Version of a part without changes."""
LINEAGE = "feedback on "
"""What the stage of approved changes in a manifest begins with; its section follows."""

HEAD = {
    "proposed": "# What the rules propose from the failures in data/hardware_logs. Copying this file to approved.yaml "
    "approves it\n# all; so does the job approve_feedback. Written by the asset curation_feedback.\n",
    "approved": "# Changes that a person approved, and the logs they rest on. An entry that is deleted is taken back, "
    "all of it\n# with the file; so does the job take_back_feedback.\n",
    "declined": "# Changes that a person declined on the curator's page: they are not asked again while they rest on "
    "the same logs.\n# An entry that is deleted is pending again.\n",
}


@dataclass(frozen=True, kw_only=True)
class SectionApproval:
    """Changes of one section that were approved together."""

    section: str
    proposal: str
    """Digest of the proposal that was reviewed."""
    by: str = ""
    """Who approved them; empty in a proposal."""
    digest: str
    """Of these changes."""
    changes: tuple[Change, ...]


@dataclass(frozen=True, kw_only=True)
class ApprovalFile:
    """`data/feedback/approved.yaml`, and the proposal that waits beside it."""

    approvals: tuple[SectionApproval, ...]


@dataclass(frozen=True, kw_only=True)
class Approvals:
    """What is approved."""

    entries: tuple[SectionApproval, ...] = ()
    """As the file has them; none where it can't be read."""
    faults: Mapping[str, PipelineError] = field(default_factory=dict)
    """Sections that can't be used, and why."""

    @property
    def changes(self) -> tuple[Change, ...]:
        """The changes of all sections that can be used."""
        return tuple(each for entry in self.entries if entry.section not in self.faults for each in entry.changes)

    @property
    def readable(self) -> bool:
        """Whether the entries are known, though sections may have faults."""
        return bool(self.entries) or not self.faults


def read_approvals(path: Path, rules: FeedbackRules) -> Approvals:
    """What a file approves; nothing where it is not there. Its faults are reported and raise nothing."""
    if not path.is_file():
        return Approvals()
    try:
        entries = settings.read(path, ApprovalFile).approvals
        for place, entry in enumerate(entries):
            named = (entry.section, *(each.section for each in entry.changes))
            strange = [name for name in named if name not in SECTIONS or name != entry.section]
            if strange:
                problem = f"approvals[{place}] of '{entry.section}' has the section '{strange[0]}'"
                raise SettingsError(path, f"{problem}, there are: {', '.join(SECTIONS)}.")
    except (SettingsError, OSError) as error:
        what = str(error) if isinstance(error, SettingsError) else f"{path}: {error.strerror}."
        answer = "decline" if path.stem == "declined" else "approve"
        fault = PipelineError(f"{what} Mend it, or delete it and {answer} again: without it nothing is {answer}d.")
        return Approvals(faults=dict.fromkeys(SECTIONS, fault))
    faults = {section: _fault(path, section, entries, rules) for section in SECTIONS}
    return Approvals(entries=entries, faults={section: fault for section, fault in faults.items() if fault})


def _fault(path: Path, section: str, entries: Sequence[SectionApproval], rules: FeedbackRules) -> SettingsError | None:
    """Why a section can't be used, with the way on."""
    own = [(place, entry) for place, entry in enumerate(entries) if entry.section == section]
    for place, entry in own:
        found = proposal_digest(entry.changes)
        if found != entry.digest:
            return SettingsError(
                path,
                f"approvals[{place}], '{section}': its changes do not have the digest '{entry.digest}' but '{found}'.",
                f"State that one if you changed them on purpose; else {_way_on(section)}",
            )
    try:
        check_bounds([change for _, entry in own for change in entry.changes], rules)
    except ChangeError as error:
        where = ", ".join(f"approvals[{place}]" for place, _ in own)
        return SettingsError(path, f"{where}: {error}.", _way_on(section).capitalize())
    return None


def _way_on(section: str) -> str:
    return (
        f"approve '{section}' of the current proposal again (job approve_feedback), or take it back (job "
        f"take_back_feedback, or delete the entry)."
    )


def entries_of(changes: Sequence[Change], proposal: str, by: str = "") -> tuple[SectionApproval, ...]:
    """Changes as entries, one a section."""
    return tuple(
        SectionApproval(section=section, proposal=proposal, by=by, digest=proposal_digest(own), changes=own)
        for section in SECTIONS
        if (own := tuple(each for each in changes if each.section == section))
    )


def added(
    earlier: Sequence[SectionApproval], new: Sequence[SectionApproval], *, whole: bool
) -> tuple[SectionApproval, ...]:
    """Earlier approvals and new ones over them; sections that the new ones do not name stay as they are.

    Args:
        whole: whether the new ones speak for their sections as a whole, so that what was approved of these before
            goes; if not, only the same numbers give way
    """
    places = {place_of(change) for entry in new for change in entry.changes}
    sections = {entry.section for entry in new}
    kept = []
    for entry in earlier:
        if entry.section not in sections:
            kept.append(entry)
            continue
        left = () if whole else tuple(each for each in entry.changes if place_of(each) not in places)
        if left:
            kept.append(dataclasses.replace(entry, changes=left, digest=proposal_digest(left)))
    order = list(SECTIONS)
    return tuple(sorted((*kept, *new), key=lambda entry: order.index(entry.section)))


def write_entries(path: Path, entries: Sequence[SectionApproval], *, head: str = "approved") -> None:
    """Write a file of approvals or of a proposal; remove it where there is nothing in it."""
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
    """The changes of a section for a robot, None for what all robots share; in one order, however they came in."""
    own = [each for each in changes if each.section == section and robot in (None, each.robot)]
    return tuple(sorted(own, key=lambda each: (each.section, each.robot, each.what)))


def part_version(part: Sequence[Change]) -> str:
    """Content of a part: that of no change is a constant."""
    return digest.of_json(settings.plain(part)) if part else EMPTY


def lineage(part: Sequence[Change], section: str) -> dict[str, Any]:
    """The changes that took effect in a manifest, by digest: each with the logs that it rests on."""
    if not part:
        return {}
    return {part_version(part): {"stage": f"{LINEAGE}{section}", "changes": settings.plain(part)}}


def noting(manifest: Manifest, part: Sequence[Change], section: str) -> Manifest:
    """The manifest, and in it the changes that took effect with the logs that they rest on; as it is without any."""
    return dataclasses.replace(manifest, settings={**manifest.settings, **lineage(part, section)})


def heard(stages: Mapping[str, Any]) -> dict[str, str]:
    """Section -> version of its part that took effect in a manifest with these stages."""
    named = {version: str(facts.get("stage", "")) for version, facts in stages.items()}
    return {stage.removeprefix(LINEAGE): version for version, stage in named.items() if stage.startswith(LINEAGE)}


def wanted_seconds(curation: Curation, changes: Sequence[Change]) -> Curation:
    """The curation with more seconds of some skills. A skill without a bound has no more to give."""
    factors: dict[str, float] = {}
    for change in changes:  # of several robots; the windows are all robots'
        factors[change.what] = max(factors.get(change.what, 1.0), change.value)
    most = {skill: seconds * factors.get(skill, 1.0) for skill, seconds in curation.most_seconds.items()}
    return dataclasses.replace(curation, most_seconds=most)


def further_variants(changes: Sequence[Change], settings: AugmentSettings) -> dict[str, AugmentSettings]:
    """Skill -> settings that make its further variants alone, beside those that all clips get."""
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
