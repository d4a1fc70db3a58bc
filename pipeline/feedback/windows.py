"""Selection of KP1's windows with the limits that approved feedback raised."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.batch import Manifest
from pipeline.clips.outcome import Reason
from pipeline.feedback.approved import with_applied_changes, with_raised_limits
from pipeline.feedback.change import Change
from pipeline.files import digest
from pipeline.selection import Curation, RaisedBound, choose, raised_bounds

BOUNDS = "bounds raised by feedback"
"""Stage name of the entry of a manifest that holds the effect of raised limits."""


def chosen_windows(
    windows: Manifest, curation: Curation, feedback: Sequence[Change]
) -> tuple[Manifest, tuple[RaisedBound, ...]]:
    """Select windows by the curation with raised limits. Returns the manifest and the effect of each raised limit.

    Windows that are not selected have a reason. The manifest records the changes and their effect.
    """

    rows, raised = windows.entry_table(), with_raised_limits(curation, feedback)
    dropped = {
        row.clip: Reason(code="not_taken", text=f"{row.clip}: {row.why}", effect="rejected").to_dict()
        for row in choose(rows, raised).itertuples()
        if not row.taken
    }
    manifest = with_applied_changes(windows.without(dropped), feedback, "selection")
    bounds = raised_bounds(rows, curation, raised, [change.what for change in feedback])
    if bounds:
        record = {"stage": BOUNDS, "bounds": [each.to_dict() for each in bounds]}
        manifest = dataclasses.replace(manifest, settings={**manifest.settings, digest.of_json(record): record})
    return manifest, bounds


def unmet_requests(stages: Mapping[str, Any]) -> tuple[str, ...]:
    """A message for each skill whose available windows do not fill the raised limit, from the stages of a manifest."""
    named = (facts for facts in stages.values() if isinstance(facts, dict) and facts.get("stage") == BOUNDS)
    bounds = [each for facts in named for each in facts["bounds"]]
    return tuple(each["text"] for each in bounds if each["short"])
