"""A reference that the tracker does not follow, held against the skill's other references."""

import pytest

from assets.robot_motions import candidate_motions
from assets.tracking import compared_with_neighbours
from pipeline.batch import Manifest
from pipeline.batch.manifest import Entry, Judged
from pipeline.tracking.process import NOT_TRACKED


def manifests(followed: int) -> tuple[Manifest, Manifest]:
    """Five references of one skill, of which the first `followed` are followed to their end, and their rollouts."""
    names = [f"walk{number}" for number in range(5)]
    references = tuple(Entry(clip=name, blob=name, numbers={"skill": "walk"}) for name in names)
    reason = {"code": NOT_TRACKED, "effect": "rejected", "text": "the tracker cannot follow it"}
    judged = tuple(
        Judged(
            clip=name,
            pieces=(f"{name}~rollout", f"{name}~rollout1"),
            reasons=() if number < followed else (reason,),
            numbers={"survived": number < followed, "seconds_out": 3.0},
        )
        for number, name in enumerate(names)
    )
    rollouts = tuple(
        Entry(clip=piece, blob=piece, numbers={"reference": row.clip}) for row in judged for piece in row.pieces
    )
    return (
        Manifest(stage="augmented_motions", entries=rollouts, judged=judged),
        Manifest(stage="reference_motions", entries=references, judged=()),
    )


def test_a_reference_that_alone_is_not_followed_is_rejected_with_all_its_rollouts():
    rollouts, references = manifests(followed=4)
    found = compared_with_neighbours(rollouts, references)
    (row,) = [row for row in found.judged if row.reasons]
    assert (row.clip, row.fate, row.numbers["seconds_out"]) == ("walk4", "rejected", 0.0)
    assert row.reasons[0]["text"].endswith(
        "follows 4 of 4 other references of the skill 'walk', so the reference is at fault"
    )
    assert {entry.numbers["reference"] for entry in found.entries} == {"walk0", "walk1", "walk2", "walk3"}


def test_where_the_skill_is_not_followed_the_rollouts_stay():
    rollouts, references = manifests(followed=3)
    found = compared_with_neighbours(rollouts, references)
    assert found.entries == rollouts.entries
    assert all("too weak for this skill" in row.reasons[0]["text"] for row in found.judged[3:])
    assert {row.fate for row in found.judged} == {"accepted", "partly"}


@pytest.mark.parametrize(("kind", "count"), [("rollouts", 8), ("references", 4), ("both", 12)])
def test_a_rejected_reference_is_no_candidate(kind, count):
    rollouts, references = manifests(followed=4)
    candidates = candidate_motions(compared_with_neighbours(rollouts, references), references, kind)
    assert len(candidates.entries) == count
    assert not any(entry.clip.startswith("walk4") for entry in candidates.entries)
