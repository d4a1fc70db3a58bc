"""The discriminator: penalty and reward against closed forms, replay, windows that stay in one clip."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
from torch import nn

from pipeline.training.bundle import ExpertFrames
from pipeline.training.discriminator import Discriminator, Replay, gradient_penalty, style_reward
from pipeline.training.expert_sampling import (
    ReferenceStates,
    cell_weights,
    expert_windows,
    frame_weights,
    window_starts,
)
from pipeline.training.motion_features import FeatureNormalizer, frame_features, window_frames, window_span
from pipeline.training.options import Options
from tests.factories.training_bundle import identity_frames

JOINTS = 21
COLUMNS = 37 + 2 * JOINTS
OPTIONS = Options(expert_windows=500, window=4, window_stride=2)


@pytest.fixture
def expert() -> ExpertFrames:
    """Two clips of 30 and 20 frames, one told to stand and one to run."""
    command = np.zeros((50, 3), dtype=np.float32)
    command[30:, 0] = 1.8
    return ExpertFrames(
        frames=identity_frames(50, COLUMNS).astype(np.float32),
        command=command,
        clip_start=np.array([0, 30, 50]),
        clip_weight=np.array([1.0, 3.0]),
    )


def test_frames_of_a_window_are_means_of_the_steps_up_to_the_next():
    steps = torch.arange(24.0).reshape(2, 6, 2)
    options = OPTIONS.changed(window=3, window_stride=2, window_means=True)
    assert window_span(options) == 6
    expected = (steps[:, ::2] + steps[:, 1::2]) / 2.0
    assert torch.equal(window_frames(steps, options), expected)
    firsts = options.changed(window_means=False)
    assert window_span(firsts) == 5
    assert torch.equal(window_frames(steps[:, :5], firsts), steps[:, :5:2])


def test_the_penalty_of_a_linear_score_is_its_slope_off_one_squared():
    score = nn.Linear(2, 1)
    with torch.no_grad():
        score.weight.copy_(torch.tensor([[3.0, 4.0]]))
    points = torch.randn(6, 2)
    penalty = gradient_penalty(score, points, points + 1.0, torch.rand(6, 1))
    assert penalty.item() == pytest.approx(16.0, rel=1e-5)
    penalty.backward()
    assert score.weight.grad is not None


@pytest.mark.parametrize(
    ("score", "reward"), [(0.0, 0.25), (1e6, 0.5), (-1e6, 0.0), (10.0, 0.25 * (1 + math.tanh(0.5)))]
)
def test_the_style_reward_is_alpha_times_one_plus_tanh(score, reward):
    assert style_reward(torch.tensor([score]), 0.25, 0.05).item() == pytest.approx(reward)


def test_windows_stay_within_one_clip(expert):
    windows = expert_windows(expert, OPTIONS, seed=0)
    assert windows.shape == (500, 4, 18 + 2 * JOINTS)
    frame = (windows[:, :, 0].numpy() - 7) / 100.0
    assert np.all(np.diff(frame, axis=1) == OPTIONS.window_stride)
    assert not np.any((frame[:, 0] < 30) & (frame[:, -1] >= 30))


def test_clips_are_drawn_by_their_weight(expert):
    starts = window_starts(expert, 7)
    weight = frame_weights(expert, starts)
    assert weight.sum() == pytest.approx(1.0)
    assert weight[starts >= 30].sum() == pytest.approx(0.75)


def test_by_cell_they_are_drawn_as_often_as_their_command_is_asked_for(expert):
    starts = window_starts(expert, 7)
    asked = Options(standing_share=0.9, fast_share=0.1)
    weight = cell_weights(expert, starts, asked, seed=0)
    assert weight[starts < 30].sum() == pytest.approx(0.9, abs=0.02)
    assert np.array_equal(weight, cell_weights(expert, starts, asked, seed=0))


def test_reference_states_come_with_the_command_they_obey(expert):
    frames, command, _ = ReferenceStates(expert, Options(), 0, "cpu").draw(400)
    index = (frames[:, 0] / 100.0).numpy().astype(int)
    assert np.array_equal(command[:, 0].numpy(), expert.command[index, 0])


def test_features_take_the_columns_the_frames_have_them_in():
    frames = torch.from_numpy(identity_frames(3, COLUMNS))
    names = frame_features(frames)[0].tolist()
    joints, ends, velocities = list(range(7, 28)), list(range(28, 40)), list(range(40, 46))
    assert names == [*joints, *ends, *velocities, *range(46, 67)]


def test_what_hardly_moves_is_divided_by_a_floor_and_cut():
    expert = torch.zeros(100, 18 + 2 * JOINTS)
    normalize = FeatureNormalizer(expert, JOINTS)
    window = torch.zeros(1, 2, 18 + 2 * JOINTS)
    window[0, 0, 0], window[0, 1, 0] = 0.2, 50.0
    value = normalize(window)
    assert value.shape == (1, 2 * (18 + 2 * JOINTS))
    assert value[0, 0].item() == pytest.approx(2.0)
    assert value.max().item() == 10.0


def test_the_replay_forgets_the_oldest():
    replay = Replay(5, (1, 1), "cpu")
    replay.insert(torch.arange(3.0)[:, None, None], torch.ones(3) > 0.0)
    assert set(replay.draw(50).flatten().tolist()) == {0.0, 1.0, 2.0}
    replay.insert(torch.arange(3.0, 7.0)[:, None, None], torch.ones(4) > 0.0)
    assert replay.count == 5
    assert set(replay.draw(200).flatten().tolist()) == {2.0, 3.0, 4.0, 5.0, 6.0}


def test_it_learns_to_score_the_expert_above_the_policy():
    torch.manual_seed(0)
    options = dataclasses.replace(OPTIONS, discriminator_batch=64, discriminator_steps=60, replay_windows=500)
    size = 18 + 2 * JOINTS
    expert = torch.randn(300, 4, size) + 2.0
    discriminator = Discriminator(expert, JOINTS, options, "cpu")
    discriminator.update()
    assert discriminator.figures == {}
    discriminator.replay.insert(torch.randn(300, 4, size) - 2.0, torch.ones(300) > 0.0)
    discriminator.update()
    assert discriminator.figures["d_expert"] > discriminator.figures["d_policy"]
    assert discriminator.score(expert[:20]).mean() > discriminator.score(torch.randn(20, 4, size) - 2.0).mean()
