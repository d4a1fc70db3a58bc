"""The discriminator: losses and reward against closed forms, replay, windows that stay in one clip."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch import nn

from pipeline.training.amp.algorithm import fill_invalid_with_mean
from pipeline.training.amp.discriminator import (
    Discriminator,
    accuracy,
    gradient_norm,
    gradient_penalty,
    style_reward,
)
from pipeline.training.amp.expert import (
    CELL,
    KEPT_SHARE,
    expert_windows,
    frame_weights,
    sample_by_command,
    window_starts,
)
from pipeline.training.amp.features import FeatureNormalizer, floors, frame_features
from pipeline.training.amp.replay import Replay
from pipeline.training.bundle import ExpertFrames
from pipeline.training.config import PAPER, RECIPE
from tests.factories.training_bundle import identity_frames

JOINTS = 21
COLUMNS = 37 + 2 * JOINTS
SIZE = 18 + 2 * JOINTS
SMALL = {"simulation.num_envs": 10, "discriminator.frames": 4}


@pytest.fixture
def expert() -> ExpertFrames:
    """Two clips of 30 and 20 frames, one that stands and one that runs."""
    command = np.zeros((50, 3), dtype=np.float32)
    command[30:, 0] = 1.8
    return ExpertFrames(
        frames=identity_frames(50, COLUMNS).astype(np.float32),
        command=command,
        clip_start=np.array([0, 30, 50]),
        clip_weight=np.array([1.0, 3.0]),
    )


def test_the_penalty_of_a_linear_score_is_its_slope_off_one_squared():
    score = nn.Linear(2, 1)
    with torch.no_grad():
        score.weight.copy_(torch.tensor([[3.0, 4.0]]))
    points = torch.randn(6, 2)
    penalty = gradient_penalty(score, points, points + 1.0, torch.rand(6, 1))
    assert penalty.item() == pytest.approx(16.0, rel=1e-5)
    penalty.backward()
    assert score.weight.grad is not None


def test_invalid_windows_get_the_mean_of_the_valid_ones():
    valid = torch.tensor([True, False, True, False])
    given = fill_invalid_with_mean(valid, torch.tensor([1.0, 100.0, 2.0, -100.0]))
    assert given.tolist() == [1.0, 1.5, 2.0, 1.5]
    assert fill_invalid_with_mean(torch.zeros(2, dtype=torch.bool), torch.tensor([5.0, 6.0])).tolist() == [0.0, 0.0]


def test_the_r1_gradient_of_a_linear_score_is_its_slope():
    score = nn.Linear(2, 1)
    with torch.no_grad():
        score.weight.copy_(torch.tensor([[3.0, 4.0]]))
    assert gradient_norm(score, torch.randn(6, 2)).tolist() == pytest.approx([5.0] * 6)


@pytest.mark.parametrize(
    ("score", "reward"), [(0.0, 0.25), (1e6, 0.5), (-1e6, 0.0), (10.0, 0.25 * (1 + math.tanh(0.5)))]
)
def test_the_style_reward_is_alpha_times_one_plus_tanh(score, reward):
    assert style_reward(torch.tensor([score]), 0.05).item() == pytest.approx(reward)


def test_with_logits_the_style_reward_is_half_the_probability_of_the_expert():
    score = torch.linspace(-4.0, 4.0, 9)
    assert style_reward(score, 0.5) == pytest.approx(0.5 * torch.sigmoid(score))


def test_accuracy_is_one_for_separated_and_half_for_equal_scores():
    low, high = torch.linspace(-2.0, -1.0, 50), torch.linspace(3.0, 4.0, 50)
    assert accuracy(high, low).item() == 1.0
    assert accuracy(low, low).item() == pytest.approx(0.5, abs=0.02)


def test_windows_stay_within_one_clip(expert):
    windows = expert_windows(expert, PAPER.changed(SMALL), seed=0)
    assert windows.shape == (1000, 4, SIZE)
    frame = (windows[:, :, 0].numpy() - 7) / 100.0
    assert np.all(np.diff(frame, axis=1) == 1)
    assert not np.any((frame[:, 0] < 30) & (frame[:, -1] >= 30))


def test_clips_are_drawn_by_their_weight(expert):
    starts = window_starts(expert, 7)
    weight = frame_weights(expert, starts)
    assert weight.sum() == pytest.approx(1.0)
    assert weight[starts >= 30].sum() == pytest.approx(0.75)


def test_by_command_frames_are_as_frequent_as_the_policys_commands(expert):
    starts = window_starts(expert, 7)
    changed = {"standing_share": 0.9, "fast_share": 0.1, "single_axis_share": 0.0}
    config = RECIPE.changed({f"commands.{name}": value for name, value in changed.items()}).commands
    given = expert.command[starts], frame_weights(expert, starts), config
    drawn, command, kept = sample_by_command(*given, seed=0, count=5000, kept_share=0.0)
    assert (starts[drawn] < 30).mean() == pytest.approx(0.9, abs=0.02) and not kept.any()
    again = sample_by_command(*given, seed=0, count=5000, kept_share=0.0)
    assert np.array_equal(drawn, again[0]) and np.array_equal(command, again[1])


def test_frames_that_keep_their_command_are_as_frequent_as_their_weight(expert):
    """So what the database weighs more is trained more, whatever commands the policy gets; but for standing."""
    starts = window_starts(expert, 7)
    config = RECIPE.changed({"commands.standing_share": 0.55, "commands.fast_share": 0.0}).commands
    given = expert.command[starts], frame_weights(expert, starts), config
    drawn, command, kept = sample_by_command(*given, seed=0, count=5000, kept_share=0.5)
    assert kept.mean() == pytest.approx(0.5, abs=0.03)
    assert (starts[drawn[kept]] >= 30).mean() == pytest.approx(0.75 * 0.45, abs=0.03)
    assert np.array_equal(command[kept], expert.command[starts[drawn[kept]]]), "clips before 30 stand"
    assert (starts[drawn[~kept]] >= 30).mean() < 0.4


def test_frames_without_weight_answer_no_command(expert):
    weight = np.concatenate([np.zeros(30), np.full(20, 0.05)])
    drawn, *_ = sample_by_command(expert.command, weight, RECIPE.commands, seed=0, count=500, kept_share=0.5)
    assert drawn.min() >= 30


def test_a_window_is_of_the_nearest_cell_or_keeps_its_own_command(expert):
    config = RECIPE.changed({**SMALL, "commands.fast_share": 0.3})
    windows = expert_windows(expert, config, seed=0)
    assert windows.shape == (1000, 4, SIZE + 3)
    command, frame = windows[:, :, SIZE:], (windows[:, 0, 0].numpy() - 7) / 100.0
    assert torch.equal(command, command[:, :1].expand(-1, 4, -1))
    given, own = command[:, 0].numpy(), expert.command[frame.round().astype(int)]
    kept = (given == own).all(axis=1)
    nearer = np.linalg.norm(given / CELL, axis=1) > np.linalg.norm((given - [1.8, 0.0, 0.0]) / CELL, axis=1)
    assert np.array_equal(nearer[~kept], frame[~kept] >= 30)
    assert (~kept).mean() == pytest.approx((1.0 - KEPT_SHARE) * (1.0 - config.commands.standing_share), abs=0.1)


def test_features_take_the_columns_the_frames_have_them_in():
    frames = torch.from_numpy(identity_frames(3, COLUMNS))
    names = frame_features(frames)[0].tolist()
    joints, ends, velocities = list(range(7, 28)), list(range(28, 40)), list(range(40, 46))
    assert names == [*joints, *ends, *velocities, *range(46, 67)]


def test_nearly_constant_features_are_divided_by_a_floor_and_clipped():
    normalize = FeatureNormalizer(torch.zeros(100, SIZE), floors(JOINTS))
    window = torch.zeros(1, 2, SIZE)
    window[0, 0, 0], window[0, 1, 0] = 0.2, 50.0
    value = normalize(window)
    assert value.shape == (1, 2 * SIZE)
    assert value[0, 0].item() == pytest.approx(2.0)
    assert value.max().item() == 10.0


def test_the_replay_forgets_the_oldest():
    replay = Replay(5, (1, 1), "cpu")
    replay.insert(torch.arange(3.0)[:, None, None], torch.ones(3) > 0.0)
    assert set(replay.draw(50).flatten().tolist()) == {0.0, 1.0, 2.0}
    replay.insert(torch.arange(3.0, 7.0)[:, None, None], torch.ones(4) > 0.0)
    assert replay.count == 5
    assert set(replay.draw(200).flatten().tolist()) == {2.0, 3.0, 4.0, 5.0, 6.0}


@pytest.mark.parametrize("loss", ["bce", "wasserstein"])
def test_it_learns_to_score_the_expert_above_the_policy(loss):
    torch.manual_seed(0)
    config = RECIPE.changed({"discriminator.loss": loss}).discriminator
    expert = torch.randn(300, 4, SIZE) + 2.0
    discriminator = Discriminator(expert, floors(JOINTS), config, 8, "cpu")
    discriminator.update()
    assert discriminator.figures == {}
    discriminator.replay.insert(torch.randn(300, 4, SIZE) - 2.0, torch.ones(300) > 0.0)
    for _ in range(8):
        discriminator.update()
    assert discriminator.figures["d_expert"] > discriminator.figures["d_policy"]
    assert discriminator.score(expert[:20]).mean() > discriminator.score(torch.randn(20, 4, SIZE) - 2.0).mean()


def test_updates_pause_while_scores_differ_by_more_than_allowed():
    torch.manual_seed(0)
    config = RECIPE.changed(
        {"discriminator.largest_difference": 0.3, "discriminator.learning_rate": 1e-3}
    ).discriminator
    discriminator = Discriminator(torch.randn(300, 4, SIZE) + 2.0, floors(JOINTS), config, 8, "cpu")
    discriminator.replay.insert(torch.randn(300, 4, SIZE) - 2.0, torch.ones(300) > 0.0)
    differences = []
    for _ in range(12):
        before = [weight.detach().clone() for weight in discriminator.network.parameters()]
        paused = discriminator.paused
        discriminator.update()
        differences.append(discriminator.figures["d_expert"] - discriminator.figures["d_policy"])
        same = [torch.equal(a, b) for a, b in zip(before, discriminator.network.parameters(), strict=True)]
        assert all(same) if paused else not any(same)
        assert discriminator.paused == (differences[-1] > 0.3)
    assert differences[0] < 0.3 < differences[-1]
    discriminator.replay.insert(torch.randn(40000, 4, SIZE) + 2.0, torch.ones(40000) > 0.0)  # the policy catches up
    discriminator.update()
    before = discriminator.network[0].weight.detach().clone()
    discriminator.update()
    assert not torch.equal(before, discriminator.network[0].weight)


@pytest.mark.parametrize(("preset", "steps", "ahead"), [(PAPER, 8, 8), (RECIPE, 1, 0)])
def test_gradient_steps_an_iteration(preset, steps, ahead, monkeypatch):
    """As many as the preset's loss takes, and as many where the discriminator is far ahead of the policy."""
    discriminator = Discriminator(torch.randn(300, 4, SIZE), floors(JOINTS), preset.discriminator, 8, "cpu")
    discriminator.replay.insert(torch.randn(300, 4, SIZE), torch.ones(300) > 0.0)
    taken = []
    monkeypatch.setattr(discriminator.optimizer, "step", lambda: taken.append(1))
    discriminator.update()
    assert len(taken) == steps
    discriminator.figures |= {"d_expert": 9.0, "d_policy": 0.0}
    discriminator.update()
    assert len(taken) == steps + ahead
