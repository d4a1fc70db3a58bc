"""Accuracy of a classifier between clips and rollouts: rollouts are made of the clips' references, family by family."""

import dataclasses
import logging

import numpy as np
import pytest

from pipeline import rotation
from pipeline.batch import ClipPool, Entry, Manifest, Stage, Store
from pipeline.clips.outcome import Outcome, Piece
from pipeline.expert import realizability
from pipeline.expert.realizability import REFERENCES, TooFewMotionsError, _chosen, accuracy_against_rollouts, windows
from tests.factories.robot_clips import standing, wandering

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


def _accuracy(store: Store, robot, clips: Manifest, references: Manifest, shift: float, asked: list) -> float:
    """With rollouts that are the references, shifted in all joints [rad]; `asked` gets the motions rolled out."""

    def rollout(clip, numbers) -> Outcome:
        asked.append(clip.name)
        moved = dataclasses.replace(clip, joint_pos=clip.joint_pos + shift, name=f"{clip.name}~rollout1")
        return Outcome(pieces=(Piece(clip=moved, numbers={"rollout": 1, "seconds": clip.duration_s}),))

    stage = Stage(name="other seed", version=str(shift), function=rollout)
    pool, log = ClipPool(backend="sequential"), logging.getLogger()
    return accuracy_against_rollouts(clips, references, stage, robot, store, pool, log)


@pytest.mark.parametrize(("shift", "least", "most"), [(0.0, 0.3, 0.7), (0.5, 0.99, 1.0)])
def test_only_motions_that_differ_from_the_rollouts_are_told_apart(robot, tmp_path, shift, least, most):
    store, asked = Store(root=tmp_path), []
    references = _manifest(store, robot, [*NAMES, "unused"])
    clips = _manifest(store, robot, [f"{name}~x1" for name in NAMES])
    assert least <= _accuracy(store, robot, clips, references, shift, asked) <= most
    assert sorted(asked) == NAMES, "no rollout of a reference that no clip tracked"


def test_only_a_changed_reference_is_rolled_out_again_and_trains_the_classifier_again(robot, tmp_path, monkeypatch):
    store, asked = Store(root=tmp_path), []
    references = _manifest(store, robot, NAMES)
    clips = _manifest(store, robot, [f"{name}~x1" for name in NAMES])
    first = _accuracy(store, robot, clips, references, 0.0, asked)
    asked.clear()
    trained = []
    train = realizability.held_out_accuracy
    monkeypatch.setattr(realizability, "held_out_accuracy", lambda *given: trained.append(1) or train(*given))
    assert _accuracy(store, robot, clips, references, 0.0, asked) == first
    assert asked == [] and trained == []
    changed = dataclasses.replace(references.entries[2], blob=store.put_clip(standing(robot, 7.0)))
    entries = (*references.entries[:2], changed, *references.entries[3:])
    _accuracy(store, robot, clips, dataclasses.replace(references, entries=entries), 0.0, asked)
    assert asked == [changed.clip] and trained == [1]


def test_another_reference_takes_the_place_of_at_most_one():
    names = [f"walk{index}~x{index}" for index in range(2 * REFERENCES)]
    entries = [Entry(clip=name, blob="", numbers={}) for name in names]
    chosen = {entry.clip for entry in _chosen(entries, seed=0)}
    assert len(chosen) == REFERENCES
    assert chosen != {entry.clip for entry in _chosen(entries, seed=1)}
    for name in ("a", "b", "c", "d"):
        with_another = {entry.clip for entry in _chosen([*entries, Entry(clip=name, blob="", numbers={})], seed=0)}
        assert len(chosen - with_another) <= 1


@pytest.mark.parametrize("count", [0, 2])
def test_a_few_motions_are_not_enough(robot, tmp_path, count):
    store = Store(root=tmp_path)
    few = _manifest(store, robot, NAMES[:count])
    with pytest.raises(TooFewMotionsError, match=r"at least 4 are needed|No motion was rolled out"):
        _accuracy(store, robot, few, few, 0.0, [])


def test_windows_do_not_tell_where_a_motion_is_and_which_way_it_heads(robot):
    """Gravity and velocities are those in the root's frame, so place and heading are nothing to tell motions apart."""
    clip = wandering(robot)
    turn = rotation.about_z(2.1)
    moved = dataclasses.replace(
        clip,
        root_pos_w=rotation.rotate(turn, clip.root_pos_w) + np.array([5.0, -3.0, 0.0]),
        root_quat_w=rotation.multiply(turn, clip.root_quat_w),
    )
    np.testing.assert_allclose(windows(moved, robot), windows(clip, robot), atol=1e-9)


def test_a_window_has_the_velocities_that_were_planted(robot):
    """A robot that leans forward by 0.3 rad walks ahead at 0.5 m/s and turns at 0.8 rad/s."""
    clip, lean, rate, speed = standing(robot, 2.0), 0.3, 0.8, 0.5
    time_s = np.arange(clip.frame_count) / clip.fps
    heading = rotation.about_z(rate * time_s)
    tilt = rotation.from_axis_angle(np.array([0.0, 1.0, 0.0]), lean)
    way = speed / rate * np.stack([np.sin(rate * time_s), 1.0 - np.cos(rate * time_s), 0.0 * time_s], axis=1)
    walks = dataclasses.replace(
        clip, root_pos_w=clip.root_pos_w + way, root_quat_w=rotation.multiply(heading, np.tile(tilt, (len(heading), 1)))
    )
    frame = windows(walks, robot)[3].reshape(realizability.WINDOW, -1)[2]
    gravity, velocity, turning = frame[-9:-6], frame[-6:-3], frame[-3:]
    cosine, sine = np.cos(lean), np.sin(lean)
    np.testing.assert_allclose(gravity, [sine, 0.0, -cosine], atol=1e-9)
    np.testing.assert_allclose(velocity, [speed * cosine, 0.0, speed * sine], atol=1e-3)
    np.testing.assert_allclose(turning, [-rate * sine, 0.0, rate * cosine], atol=1e-3)
    assert frame[-10] == pytest.approx(robot.default_root_height)
