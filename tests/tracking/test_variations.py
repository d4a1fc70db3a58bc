"""Accepted disturbed rollouts are counted by source clip, a rollout in two pieces once."""

import pytest

from pipeline.batch import Entry, Judged, Manifest
from pipeline.tracking.variations import accepted_variations, distances


def manifest(*entries: Entry, judged: tuple[Judged, ...] = ()) -> Manifest:
    return Manifest(stage="made", entries=entries, judged=judged)


def piece(name: str, reference: str, rollout: int, error: float = 0.02) -> Entry:
    numbers = {"reference": reference, "rollout": rollout, "body_error_m": error, "joint_error_rad": 2.0 * error}
    return Entry(clip=name, blob="", numbers=numbers)


def tracked(name: str, rollouts: int) -> Judged:
    return Judged(clip=name, pieces=(), reasons=(), numbers={"rollouts": rollouts})


def test_a_rollout_counts_once_for_the_source_clip_of_its_reference():
    rollouts = manifest(judged=(tracked("walk@0-9", 5), tracked("walk@0-9~mirror", 5), tracked("run@0-9", 3)))
    feasible = manifest(
        piece("walk@0-9~rollout", "walk@0-9", 0),
        piece("walk@0-9~rollout1+0", "walk@0-9", 1),
        piece("walk@0-9~rollout1+1", "walk@0-9", 1),
        piece("walk@0-9~mirror~rollout1", "walk@0-9~mirror", 1),
    )
    assert accepted_variations(rollouts, feasible).to_dict("records") == [
        {"source_clip": "run@0-9", "tried": 2, "accepted": 0, "share": 0.0},
        {"source_clip": "walk@0-9", "tried": 8, "accepted": 2, "share": 0.25},
    ]


def test_distances_are_those_of_disturbed_rollouts():
    pieces = [piece(f"walk~rollout{number}", "walk", number, 0.01 * number) for number in range(12)]
    found = distances(manifest(*pieces))
    assert list(found["quantile"]) == [0.1, 0.5, 0.9, 1.0]
    assert list(found["body_error_m"]) == pytest.approx([0.02, 0.06, 0.10, 0.11])
    assert list(found["joint_error_rad"]) == pytest.approx([0.04, 0.12, 0.20, 0.22])


def test_a_database_of_references_has_no_variations():
    references = manifest(Entry(clip="walk", blob="", numbers={}))
    assert accepted_variations(manifest(), references).empty and distances(references).empty
