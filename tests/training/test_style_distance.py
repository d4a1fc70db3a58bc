"""The distance of a walk from the expert's: closed forms, and a clip against itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from pipeline.errors import FileError
from pipeline.learning.training_error import TrainingError
from pipeline.training import style_distance
from pipeline.training.amp.features import FeatureNormalizer, floors
from pipeline.training.bundle import ExpertFrames
from pipeline.training.plain_walk import Walk, measure_walk
from pipeline.training.policy_figures import style_figures
from pipeline.training.style_distance import energy_distance, expert_sets, walk_features, windows_of
from tests.factories.training_bundle import small_bundle


def test_two_points_d_apart_in_every_feature_are_the_root_of_two_d_apart():
    one, other = np.zeros((5, 9)), np.full((7, 9), 0.5)
    assert energy_distance(one, other) == pytest.approx(1.0)
    assert energy_distance(one, one) == 0.0


def test_an_empty_sample_has_no_distance():
    """So where one clip alone has the speed, the distance between its halves is not 0, as if they were equal."""
    assert math.isnan(energy_distance(np.ones((5, 9)), np.ones((0, 9))))


def test_the_distance_of_samples_grows_with_their_shift():
    rng = np.random.default_rng(0)
    sample = rng.normal(size=(400, 20))
    distances = [energy_distance(sample, rng.normal(size=(400, 20)) + shift) for shift in (0.0, 0.2, 1.0)]
    assert distances[0] < 0.1 < distances[1] < distances[2]


def test_windows_near_a_command_are_taken_and_halves_share_no_clip():
    command = np.zeros((120, 3), dtype=np.float32)
    command[:90, 0] = 1.0
    expert = ExpertFrames(
        frames=np.zeros((120, 79), dtype=np.float32),
        command=command,
        clip_start=np.array([0, 30, 60, 90, 120]),
        clip_weight=np.ones(4),
    )
    every, odd, even = expert_sets(expert, (1.0, 0.0, 0.0), np.random.default_rng(0))
    assert len(every) == 3 * (30 - 9)
    assert set(every) == set(odd) | set(even)
    assert {int(start) // 30 for start in odd} == {0, 2}
    assert {int(start) // 30 for start in even} == {1}
    assert [len(each) for each in expert_sets(expert, (0.0, 0.0, 0.0), np.random.default_rng(0))] == [21, 21, 0]
    with pytest.raises(TrainingError, match="no frame near the command"):
        expert_sets(expert, (2.0, 0.0, 0.0), np.random.default_rng(0))


def test_features_of_a_walk_have_the_commanded_speed_and_falls_are_refused(tmp_path, root, robot):
    bundle, policy = small_bundle(tmp_path, root, robot), root / "robots" / "t1" / "policies" / "walk" / "policy.npz"
    walk = Walk(command=(0.6, 0.0, 0.0), seconds=8.0)
    features = walk_features(bundle, policy, walk)
    assert features.shape == (298, 60)  # without the first and the last step
    forward = measure_walk(bundle, policy, walk)["forward"]
    assert 0.4 < forward < 0.8
    assert features[:, 33].mean() == pytest.approx(forward, abs=0.02), "the features' forward velocity is the base's"
    assert np.abs(features[:, 34]).mean() < 0.15
    moved = np.abs(np.diff(features, axis=0)).max(axis=0)
    assert moved.min() > 1e-6, "every joint, hand, foot and velocity changes from step to step"
    normalize = FeatureNormalizer(torch.from_numpy(features), floors(21))
    windows = windows_of(features, np.arange(100), normalize)
    assert windows.shape == (100, 240)
    assert np.abs(windows).max() <= 10.0
    with pytest.raises(TrainingError, match="falls at the command"):
        walk_features(bundle, policy, Walk(command=(9.0, 0.0, 0.0)))


def test_a_fall_or_missing_speed_does_not_affect_other_speeds(tmp_path, root, robot, monkeypatch, capsys):
    bundle, policy = small_bundle(tmp_path, root, robot), tmp_path / "policy.npz"

    def walked(bundle, policy, walk):
        if walk.command[0] == 1.0:
            raise TrainingError(f"{policy}: falls")
        return np.zeros((300, 60), dtype=np.float32)

    def sets(expert, command, rng):
        if command[0] == 1.5:
            raise TrainingError("no frame near the command")
        return (np.arange(20),) * 3

    monkeypatch.setattr(style_distance, "walk_features", walked)
    monkeypatch.setattr(style_distance, "expert_sets", sets)
    figures = style_figures(bundle, policy)
    assert [math.isnan(value) for value in figures.values()] == [False, True, True]
    told = capsys.readouterr().err
    assert told.count("falls") == 3 and told.count("no frame near") == 1, "each seed's walk, and the speed once"


def test_what_is_no_policy_is_refused_by_name(tmp_path, root, robot):
    bundle, walk = small_bundle(tmp_path, root, robot), Walk(command=(0.6, 0.0, 0.0), seconds=8.0)
    (tmp_path / "noise.npz").write_bytes(b"no archive")
    for name, says in (("noise.npz", "not a NumPy archive"), ("gone.npz", "there is no such file")):
        with pytest.raises(FileError, match=rf"{name}: .*{says}"):
            walk_features(bundle, tmp_path / name, walk)
