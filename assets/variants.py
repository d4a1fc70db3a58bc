"""Further variants of some clips, added to what KP4 made of all."""

import dataclasses

from pipeline.batch import Manifest


def with_further_variants(manifest: Manifest, made: Manifest) -> Manifest:
    """The manifest and the time-scaled variants of another one; the clips of both are the same."""
    there = {entry.clip for entry in manifest.entries}
    new = [entry for entry in made.entries if entry.clip not in there]
    seconds = {entry.clip: float(entry.numbers.get("seconds", 0.0)) for entry in new}
    judged = []
    further = {row.clip: [clip for clip in row.pieces if clip in seconds] for row in made.judged}
    for row in manifest.judged:
        names = further.get(row.clip, [])
        more_s = sum(seconds[name] for name in names)
        numbers = {**row.numbers, "seconds_out": row.numbers.get("seconds_out", 0.0) + more_s}
        judged.append(dataclasses.replace(row, pieces=(*row.pieces, *names), numbers=numbers) if names else row)
    return dataclasses.replace(
        manifest,
        entries=(*manifest.entries, *new),
        judged=tuple(judged),
        settings={**manifest.settings, **made.settings},
        recomputed=manifest.recomputed + made.recomputed,
    )
