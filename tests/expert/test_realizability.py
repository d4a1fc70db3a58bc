"""Accuracy of a classifier between clips and rollouts: rollouts are made of the clips' references, family by family."""

import dataclasses

import numpy as np
import pytest

from pipeline.batch import ClipPool, Entry, Manifest, Store
from pipeline.clips.outcome import Outcome, Piece
from pipeline.expert.realizability import SECONDS, TooFewMotionsError, accuracy_against_rollouts
from tests.factories.robot_clips import standing

NAMES = [f"walk{index}" for index in range(6)]


def _manifest(store: Store, robot, names: list[str]) -> Manifest:
    entries = []
    for index, name in enumerate(names):
        clip = standing(robot, 8.0)
        frames = np.arange(clip.frame_count)
        joints = clip.joint_pos + 0.05 * np.sin(0.1 * frames + index)[:, None]
        blob = store.put_clip(dataclasses.replace(clip, joint_pos=joints))
        reference = {"reference": name.removesuffix("~x1")} if "~" in name else {}
        entries.append(Entry(clip=name, blob=blob, numbers=reference))
    return Manifest(stage="made", entries=tuple(entries), judged=())


@pytest.mark.parametrize(("shift", "least", "most"), [(0.0, 0.3, 0.7), (0.5, 0.99, 1.0)])
def test_only_motions_that_differ_from_the_rollouts_are_told_apart(robot, tmp_path, shift, least, most):
    store, lengths = Store(root=tmp_path), []

    def rollout(clip, numbers) -> Outcome:
        lengths.append(clip.duration_s)
        moved = dataclasses.replace(clip, joint_pos=clip.joint_pos + shift)
        untouched = dataclasses.replace(clip, joint_pos=clip.joint_pos + 9.0)
        return Outcome(
            pieces=(Piece(clip=untouched, numbers={"rollout": 0}), Piece(clip=moved, numbers={"rollout": 1}))
        )

    references = _manifest(store, robot, [*NAMES, "unused"])
    clips = _manifest(store, robot, [f"{name}~x1" for name in NAMES])
    pool = ClipPool(backend="sequential")
    accuracy = accuracy_against_rollouts(clips, references, rollout, robot, store, pool)
    assert least <= accuracy <= most
    assert len(lengths) == len(NAMES), "no rollout of a reference that no clip tracked"
    assert max(lengths) <= SECONDS


def test_a_few_motions_are_not_enough(robot, tmp_path):
    store = Store(root=tmp_path)
    few = _manifest(store, robot, NAMES[:2])
    pool = ClipPool(backend="sequential")
    with pytest.raises(TooFewMotionsError, match="at least 4 are needed"):
        accuracy_against_rollouts(few, few, lambda clip, numbers: Outcome(), robot, store, pool)
