"""Acceptance of disturbed rollouts by KP5 per source clip, and their distance to the tracked motion."""

from collections import Counter, defaultdict

import numpy as np
import pandas as pd

from pipeline.batch import Manifest

QUANTILES = (0.1, 0.5, 0.9, 1.0)


def accepted_variations(rollouts: Manifest, feasible: Manifest) -> pd.DataFrame:
    """One row per source clip with `source_clip, tried, accepted, share`, sorted by `accepted`.

    A source clip is a window of a recording with its mirror image and all variants. A disturbed rollout of any of them
    is accepted if KP5 keeps a piece of it. Source clips without any rollout are not listed.

    Args:
        rollouts: manifest of `augmented_motions`
        feasible: manifest of KP5 on them
    """
    tried = Counter[str]()
    for row in rollouts.judged:
        tried[_source(row.clip)] += max(int(row.numbers.get("rollouts") or 1) - 1, 0)
    accepted: dict[str, set[tuple[str, int]]] = defaultdict(set)
    for entry in feasible.entries:
        if entry.numbers.get("rollout"):
            reference = str(entry.numbers["reference"])
            accepted[_source(reference)].add((reference, int(entry.numbers["rollout"])))
    rows = [
        {"source_clip": name, "tried": count, "accepted": len(accepted[name]), "share": len(accepted[name]) / count}
        for name, count in tried.items()
        if count
    ]
    table = pd.DataFrame(rows, columns=["source_clip", "tried", "accepted", "share"])
    return table.sort_values(by=["accepted", "source_clip"], ignore_index=True)


def distances(feasible: Manifest) -> pd.DataFrame:
    """Quantiles over the accepted pieces of disturbed rollouts: `quantile, body_error_m, joint_error_rad`.

    The errors are means over a piece, of 14 links (root- and heading-aligned) and of the joints, to its reference.
    """
    pieces = [entry.numbers for entry in feasible.entries if entry.numbers.get("rollout")]
    columns = ("body_error_m", "joint_error_rad")
    if not pieces:
        return pd.DataFrame(columns=["quantile", *columns])
    values = {name: np.quantile([float(numbers[name]) for numbers in pieces], QUANTILES) for name in columns}
    return pd.DataFrame({"quantile": QUANTILES, **values})


def _source(clip: str) -> str:
    """The source clip: the name before the first variant suffix."""
    return clip.split("~")[0]
