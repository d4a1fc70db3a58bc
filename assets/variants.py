"""What KP4 makes of all clips, and what it makes of the clips of some skills besides."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from pipeline.batch import Entry, Manifest
from pipeline.feedback.change import Change

MakeVariants = Callable[[Any, Sequence[Entry]], Manifest]
"""`make(settings, entries)`: the stage with these settings on these entries, on all where there are none."""


def all_variants(retargeted: Manifest, values: Any, feedback: Sequence[Change], make: MakeVariants) -> Manifest:
    """The variants of all clips by the settings `values`, and those that approved changes want of the clips of a skill.

    A variant of a mirror image is of the mirrored skill, so the clips on the skill's other side are worked on too.
    """
    from pipeline.augment.mirror import mirror_skill
    from pipeline.feedback.approved import further_variants

    manifest = make(values, ())
    for skill, further in further_variants(feedback, values).items():
        sides = {skill, mirror_skill(skill)} if values.mirror else {skill}
        entries = [entry for entry in retargeted.entries if entry.numbers.get("skill") in sides]
        if entries:
            manifest = with_further_variants(manifest, make(further, entries), skill)
    return manifest


def with_further_variants(manifest: Manifest, made: Manifest, skill: str) -> Manifest:
    """The manifest and the variants of a skill in another one; the clips of both are the same."""
    there = {entry.clip for entry in manifest.entries}
    new = [entry for entry in made.entries if entry.clip not in there and entry.numbers.get("skill") == skill]
    seconds = {entry.clip: float(entry.numbers.get("seconds", 0.0)) for entry in new}
    rows = {row.clip: row for row in made.judged}
    judged = []
    for row in manifest.judged:
        if row.clip in rows:
            names = [clip for clip in rows[row.clip].pieces if clip in seconds]
            more_s = sum(seconds[name] for name in names)
            numbers = {**row.numbers, "seconds_out": row.numbers.get("seconds_out", 0.0) + more_s}
            reasons = (*row.reasons, *rows[row.clip].reasons)
            row = dataclasses.replace(row, pieces=(*row.pieces, *names), numbers=numbers, reasons=reasons)
        judged.append(row)
    return dataclasses.replace(
        manifest,
        entries=(*manifest.entries, *new),
        judged=tuple(judged),
        settings={**manifest.settings, **made.settings},
        recomputed=manifest.recomputed + made.recomputed,
        unsound=manifest.unsound + made.unsound,
    )
