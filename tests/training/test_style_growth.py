"""Schedules, the gate of the style reward, and what the discriminator sees of the command."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.training.amp_ppo import AmpPpo
from pipeline.training.bundle import ExpertFrames
from pipeline.training.commands import draw_commands
from pipeline.training.curves import BINS, followed
from pipeline.training.discriminator import Discriminator
from pipeline.training.expert_sampling import answering_starts, asked_commands, expert_windows, window_starts
from pipeline.training.motion_features import floors
from pipeline.training.options import Options
from pipeline.training.presets import preset
from pipeline.training.run import RunRequest, scheduled
from tests.factories.training_bundle import identity_frames

JOINTS = 21
SHARE = Options(style=0.5, style_iterations=(100, 300), style_gate=(0.4, 0.8))


@pytest.fixture
def expert() -> ExpertFrames:
    """Two clips, one that stands and one that walks at 1 m/s."""
    command = np.zeros((80, 3), dtype=np.float32)
    command[40:, 0] = 1.0
    return ExpertFrames(
        frames=identity_frames(80, 37 + 2 * JOINTS).astype(np.float32),
        command=command,
        clip_start=np.array([0, 40, 80]),
        clip_weight=np.array([1.0, 1.0]),
    )


def algorithm(options: Options, iteration: float, reached: float) -> AmpPpo:
    """An algorithm that knows no more than how far it is."""
    one = AmpPpo.__new__(AmpPpo)
    one._options, one.iteration, one.followed = options, iteration, reached
    return one


@pytest.mark.parametrize(
    ("iteration", "reached", "share"),
    [(50, 1.0, 0.0), (200, 1.0, 0.25), (900, 1.0, 0.5), (900, 0.6, 0.25), (900, 0.3, 0.0), (200, 0.6, 0.125)],
)
def test_style_grows_with_time_and_with_what_is_followed(iteration, reached, share):
    assert algorithm(SHARE, iteration, reached).style_share() == pytest.approx(share)


def test_without_a_gate_and_a_span_style_is_there_from_the_start():
    assert algorithm(Options(style=0.3), 0, 0.0).style_share() == pytest.approx(0.3)


def test_the_learning_rate_is_held_to_less_at_the_end():
    options = Options(desired_kl=0.02, final_kl=0.004, final_iterations=(1000, 1200))
    held = [algorithm(options, at, 0.0).held_kl() for at in (0, 1000, 1100, 1500)]
    assert held == pytest.approx([0.02, 0.02, 0.012, 0.004])
    assert algorithm(Options(desired_kl=0.02), 5000, 0.0).held_kl() == 0.02


def test_exploration_is_held_below_a_bound_that_sinks():
    options = Options(init_std=0.6, std_end=0.25, std_iterations=(300, 900))
    bounds = [algorithm(options, at, 0.0).largest_deviation() for at in (0, 300, 600, 2000)]
    assert bounds == pytest.approx([0.6, 0.6, 0.375, 0.15])
    assert algorithm(Options(), 2000, 0.0).largest_deviation() == float("inf")


def test_what_is_followed_is_the_mean_over_moving_commands_each_at_most_one():
    figures = {f"{name}_{kind}": float("nan") for name in BINS for kind in ("commanded", "achieved")}
    assert followed(figures) is None
    figures |= {"stand_commanded": 0.0, "stand_achieved": 0.2, "mid_commanded": 1.0, "mid_achieved": 0.5}
    assert followed(figures) == pytest.approx(0.5)
    figures |= {"turn_commanded": 1.0, "turn_achieved": 1.2, "side_commanded": 0.5, "side_achieved": -0.2}
    assert followed(figures) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("planned", "minutes", "seconds", "at"),
    [(1500, 20.0, 600.0, 750.0), (1500, None, 600.0, 40.0), (0, 20.0, 600.0, 40.0), (1500, 20.0, 0.0, 12.0)],
)
def test_schedules_go_by_the_runs_minutes_where_it_has_them(tmp_path, planned, minutes, seconds, at):
    request = RunRequest(
        out=tmp_path,
        preset="paper",
        options=Options(run_iterations=planned),
        num_envs=8,
        device="cpu",
        seed=1,
        iterations=5000,
        minutes=minutes,
        resume=False,
    )
    assert scheduled(request, 40, seconds) == pytest.approx(at)


def test_slow_commands_are_as_often_as_asked_for_and_on_one_axis():
    torch.manual_seed(0)
    plain, more = preset("gated_style").changed(slow_share=0.0), preset("gated_style")

    def slow(options: Options) -> float:
        command = draw_commands(40_000, options, "cpu")
        planar = command[:, :2].abs()
        one = (planar > 0.0).sum(dim=1) == 1
        inside = (planar.amax(dim=1) >= 0.2) & (planar.amax(dim=1) <= 0.4)
        return (one & inside & (command[:, 2] == 0.0)).float().mean().item()

    assert slow(more) - slow(plain) == pytest.approx(0.10, abs=0.01)
    assert (draw_commands(40_000, more, "cpu") == 0.0).all(dim=1).float().mean().item() == pytest.approx(0.1, abs=0.01)


def test_commands_are_answered_by_clips_near_them(expert):
    starts = window_starts(expert, 7)
    asked = np.array([[0.1, 0.0, 0.0], [0.8, 0.1, 0.0], [2.0, 0.0, 0.0]]).repeat(50, axis=0)
    drawn = answering_starts(expert, starts, asked, np.random.default_rng(0))
    assert np.all(drawn[:50] < 40)
    assert np.all(drawn[50:] >= 40)


def test_the_discriminator_sees_commands_that_are_distributed_as_the_policys(expert):
    options = preset("gated_style").changed(expert_windows=4000)
    windows = expert_windows(expert, options, seed=3)
    assert windows.shape == (4000, 4, 18 + 2 * JOINTS + 3)
    command = windows[:, :, -3:]
    assert torch.equal(command, command[:, :1].expand(-1, 4, -1))
    assert torch.equal(command[:, 0], torch.from_numpy(asked_commands(4000, options, 3)))
    fast = command[:, 0, 0] > 0.6
    frame = (windows[:, 0, 0] - 7) / 100.0
    assert torch.equal(frame[fast] >= 40, torch.ones_like(frame[fast], dtype=torch.bool))
    plain = expert_windows(expert, options.changed(discriminator_command=False), seed=3)
    assert plain.shape == (4000, 4, 18 + 2 * JOINTS)


def test_a_discriminator_that_sees_the_command_tells_standing_though_told_to_walk():
    """Expert and policy move alike and are told alike; only what goes with what differs."""
    torch.manual_seed(0)
    options = Options(
        discriminator_batch=128, discriminator_steps=150, replay_windows=2000, discriminator_rate=2e-3
    ).changed(discriminator_hidden=(64,))
    size, count = 18 + 2 * JOINTS, 2000

    def windows(command: torch.Tensor, speed: torch.Tensor) -> torch.Tensor:
        frames = 0.1 * torch.randn(len(command), 4, size + 3)
        frames[..., size] = command[:, None]
        frames[..., JOINTS + 12] = speed[:, None]
        return frames

    told = (torch.rand(count) < 0.5).float()
    moves = (torch.rand(count) < 0.5).float()
    discriminator = Discriminator(windows(told, told), JOINTS, options, "cpu")
    discriminator.replay.insert(windows(told, moves), torch.ones(count) > 0.0)
    discriminator.update()
    one, none = torch.ones(100), torch.zeros(100)
    obeys, stands = (discriminator.score(windows(one, speed)).mean().item() for speed in (one, none))
    assert obeys > stands + 0.5
    assert len(floors(JOINTS, command=True)) == size + 3
    assert floors(JOINTS, ang_vel=1.0)[-JOINTS - 3 : -JOINTS].tolist() == [1.0, 1.0, 1.0]
    with pytest.raises(KeyError, match="angvel"):
        floors(JOINTS, angvel=1.0)
