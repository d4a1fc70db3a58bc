"""A reference that the tracker does not follow is rejected where the tracker follows its neighbours."""

import dataclasses

import pytest

from assets.robot_motions import candidate_motions
from pipeline.batch import Entry, Judged, Manifest
from pipeline.tracking.neighbours import compared_with_neighbours
from pipeline.tracking.process import NOT_TRACKED

REASON = {"code": NOT_TRACKED, "effect": "rejected", "text": "the tracker cannot follow it"}


def tracked(*references: tuple[str, str, bool]) -> tuple[Manifest, Manifest]:
    """Rollouts, two of each reference, and references of the skill 'walk', each (name, variant, followed)."""
    judged = tuple(
        Judged(
            clip=name,
            pieces=(f"{name}~rollout", f"{name}~rollout1"),
            reasons=() if followed else (REASON,),
            numbers={"survived": followed, "seconds_out": 3.0},
        )
        for name, _, followed in references
    )
    rollouts = tuple(
        Entry(clip=piece, blob=piece, numbers={"reference": row.clip}) for row in judged for piece in row.pieces
    )
    entries = tuple(
        Entry(clip=name, blob=name, numbers={"skill": "walk", "variant": variant}) for name, variant, _ in references
    )
    return (
        Manifest(stage="augmented_motions", entries=rollouts, judged=judged),
        Manifest(stage="reference_motions", entries=entries, judged=()),
    )


def originals(followed: int) -> list[tuple[str, str, bool]]:
    """Five originals of which the first ones are followed."""
    return [(f"walk{number}", "original", number < followed) for number in range(5)]


def names(manifest: Manifest) -> set[str]:
    return {str(entry.numbers["reference"]) for entry in manifest.entries}


def test_a_reference_that_alone_is_not_followed_is_rejected():
    found = compared_with_neighbours(*tracked(*originals(4)))
    (row,) = [row for row in found.judged if row.reasons]
    assert (row.clip, row.fate, row.numbers["seconds_out"]) == ("walk4", "rejected", 0.0)
    assert row.reasons[0]["text"] == (
        "the tracker cannot follow it. It follows 4 of 4 other motions of the skill 'walk' and their mirror images, so "
        "the reference is at fault"
    )
    assert names(found) == {"walk0", "walk1", "walk2", "walk3"}, "none of its rollouts is left, disturbed or not"


def test_where_the_skill_is_not_followed_its_rollouts_are_kept():
    rollouts, references = tracked(*originals(3))
    found = compared_with_neighbours(rollouts, references)
    assert found.entries == rollouts.entries
    assert all("too weak for this skill" in row.reasons[0]["text"] for row in found.judged[3:])
    assert {row.fate for row in found.judged} == {"accepted", "partly"}


def test_a_variant_is_compared_with_motions_as_they_were_retargeted():
    found = compared_with_neighbours(*tracked(("walk", "original", True), ("walk~x0.9", "x0.9", False)))
    assert names(found) == {"walk"}
    assert "follows 1 of 1 other motions" in found.judged[1].reasons[0]["text"]


def test_a_reference_without_neighbours_is_kept():
    rollouts, references = tracked(("walk", "original", False), ("walk~x0.9", "x0.9", True))
    found = compared_with_neighbours(rollouts, references)
    assert found.entries == rollouts.entries
    assert "No other motion of the skill 'walk' was tracked" in found.judged[0].reasons[0]["text"]


@pytest.mark.parametrize("followed", [True, False])
@pytest.mark.parametrize("base", [3, 4, 5])
def test_further_variants_change_no_verdict_on_other_references(base: int, followed: bool):
    """Feedback from hardware logs asks for variants of a skill: earlier clips must not come or go."""
    own = [*originals(base), ("walk0~mirror", "mirror", True), ("walk0~x0.9", "x0.9", False)]
    further = [(f"walk{number}~x0.8{number}", f"x0.8{number}", followed) for number in range(5)]
    before = compared_with_neighbours(*tracked(*own))
    after = compared_with_neighbours(*tracked(*own, *further))
    assert after.judged[: len(own)] == before.judged
    assert {name for name in names(after) if "~x0.8" not in name} == names(before)


@pytest.mark.parametrize(("kind", "count"), [("rollouts", 8), ("references", 4), ("both", 12)])
def test_a_rejected_reference_is_no_candidate_of_kp5(kind: str, count: int):
    rollouts, references = tracked(*originals(4))
    candidates = candidate_motions(compared_with_neighbours(rollouts, references), references, kind)
    assert len(candidates.entries) == count
    assert not any(entry.clip.startswith("walk4") for entry in candidates.entries)


def test_a_reference_that_failed_for_another_reason_is_no_neighbour():
    rollouts, references = tracked(*originals(4))
    broken = dataclasses.replace(rollouts.judged[0], pieces=(), numbers={}, reasons=({**REASON, "code": "rate"},))
    rollouts = dataclasses.replace(rollouts, judged=(broken, *rollouts.judged[1:]))
    found = compared_with_neighbours(rollouts, references)
    assert "follows 3 of 3 other motions" in found.judged[4].reasons[0]["text"]
