"""KP1's windows with those that approved feedback asks for; what is short of it is reported."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.batch import Manifest
from pipeline.clips.outcome import Reason
from pipeline.feedback.approved import noting, wanted_seconds
from pipeline.feedback.change import Change
from pipeline.files import digest
from pipeline.selection import Curation, RaisedBound, choose, raised_bounds

BOUNDS = "bounds raised by feedback"
"""Stage name under which a manifest says what raised bounds brought."""


def chosen_windows(
    windows: Manifest, curation: Curation, feedback: Sequence[Change]
) -> tuple[Manifest, tuple[RaisedBound, ...]]:
    """The windows that are taken, the others with their reason, and what each bound brought that feedback raised.

    The manifest names the changes and what they brought; without changes it is as the curation alone makes it.
    """

    rows, wanted = windows.entry_table(), wanted_seconds(curation, feedback)
    dropped = {
        row.clip: Reason(code="not_taken", text=f"{row.clip}: {row.why}", effect="rejected").to_dict()
        for row in choose(rows, wanted).itertuples()
        if not row.taken
    }
    manifest = noting(windows.without(dropped), feedback, "selection")
    bounds = raised_bounds(rows, curation, wanted, [change.what for change in feedback])
    if bounds:
        record = {"stage": BOUNDS, "bounds": [each.to_dict() for each in bounds]}
        manifest = dataclasses.replace(manifest, settings={**manifest.settings, digest.of_json(record): record})
    return manifest, bounds


def short_of_wanted(stages: Mapping[str, Any]) -> tuple[str, ...]:
    """A message for each skill that feedback requests more of than there is, from the stages of a manifest."""
    named = (facts for facts in stages.values() if isinstance(facts, dict) and facts.get("stage") == BOUNDS)
    bounds = [each for facts in named for each in facts["bounds"]]
    return tuple(each["text"] for each in bounds if each["short"])
