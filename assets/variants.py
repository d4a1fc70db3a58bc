"""Further variants of some clips, added to what KP4 made of all."""

import dataclasses

from pipeline.batch import Manifest


def with_further_variants(manifest: Manifest, made: Manifest, skill: str) -> Manifest:
    """The manifest and the variants of a skill in another one; the clips of both are the same.

    A clip's mirror image may be of another skill than the clip: what counts is the variant's own.
    """
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
    )
