"""The file of approved changes: read whole, held against the rules, and split by what each part feeds.

`data/feedback/proposed.yaml` has the same form, so that copying it is approving it. A digest in the file ties the text
to the proposal that was looked at: a change edited by hand must state its own.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import SettingsError
from pipeline.feedback.change import SECTIONS, Change, ChangeError, check_bounds, proposal_digest
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import atomic, digest, settings

EMPTY = "none"
"""Version of a part without changes."""

HEAD = {
    "proposed": "# What the rules propose from the failures in data/hardware_logs. Copying this file to approved.yaml "
    "approves it;\n# so does the job approve_feedback. Written by the asset curation_feedback.\n",
    "approved": "# Changes that a person approved, and the logs they rest on. Deleting this file takes them back.\n",
}


@dataclass(frozen=True, kw_only=True)
class ChangeFile:
    """Changes as a file holds them."""

    proposal: str
    """Digest of the changes."""
    by: str = ""
    """Who approved them."""
    changes: tuple[Change, ...]


def read_changes(path: Path, rules: FeedbackRules | None) -> tuple[Change, ...]:
    """The changes of a file; none where it is not there. Raises SettingsError.

    With rules, changes that they do not allow are an error too.
    """
    if not path.is_file():
        return ()
    held = settings.read(path, ChangeFile)
    unknown = [each.section for each in held.changes if each.section not in SECTIONS]
    if unknown:
        raise SettingsError(path, f"unknown section '{unknown[0]}', there are: {', '.join(SECTIONS)}.")
    if proposal_digest(held.changes) != held.proposal:
        raise SettingsError(
            path,
            f"its changes are not those of proposal '{held.proposal}' but of '{proposal_digest(held.changes)}'.",
            "Approve the proposal again, or state that digest if you changed it on purpose.",
        )
    try:
        if rules is not None:
            check_bounds(held.changes, rules)
    except ChangeError as error:
        raise SettingsError(path, f"{error}.", "Approve the current proposal, or delete the file.") from error
    return held.changes


def write_changes(path: Path, changes: Sequence[Change], *, by: str = "") -> str:
    """Write a file of changes, or remove it where there are none; the digest."""
    if not changes:
        path.unlink(missing_ok=True)
        return ""
    found = proposal_digest(changes)
    held: dict[str, Any] = {"proposal": found, **({"by": by} if by else {})}
    held["changes"] = json.loads(json.dumps([each.to_dict() for each in changes]))
    head = HEAD["approved" if by else "proposed"]
    atomic.write_text(path, head + yaml.safe_dump(held, sort_keys=False, allow_unicode=True, width=120))
    return found


def part_of(changes: Sequence[Change], section: str, robot: str | None) -> tuple[Change, ...]:
    """The changes of a section for a robot; None for what all robots share."""
    return tuple(each for each in changes if each.section == section and robot in (None, each.robot))


def part_version(part: Sequence[Change]) -> str:
    """Content of a part: that of no change is a constant."""
    return digest.of_json([each.to_dict() for each in part]) if part else EMPTY


def lineage(part: Sequence[Change], section: str) -> dict[str, Any]:
    """What a manifest says of the changes that took effect in it, by digest: each with the logs that it rests on."""
    if not part:
        return {}
    return {part_version(part): {"stage": f"feedback on {section}", "changes": [each.to_dict() for each in part]}}
