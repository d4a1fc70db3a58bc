"""Commands and delays: distributions, slew, start of episodes."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch

from pipeline.training.bundle import read_bundle
from pipeline.training.config import PAPER, RECIPE
from pipeline.training.environment import AmpEnvironment
from pipeline.training.mdp.actions import SCALE
from pipeline.training.mdp.commands import NORMAL, SLEW, draw_commands
from tests.factories.training_bundle import small_bundle

ENVS = 40


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("commands"), root, robot))


def drawn(config, count=40_000):
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        return draw_commands(count, config.commands, "cpu")


@pytest.mark.parametrize("config", [RECIPE, PAPER])
def test_kinds_of_commands_have_their_shares(config):
    command, shares = drawn(config), config.commands
    zeros = (command == 0.0).sum(dim=1)
    fast = (command[:, 0] > 1.0) & (command[:, 1] == 0.0)
    assert (zeros == 3).float().mean().item() == pytest.approx(shares.standing_share, abs=0.01)
    assert fast.float().mean().item() == pytest.approx(shares.fast_share, abs=0.01)
    for axis in range(3):
        alone = (zeros == 2) & (command[:, axis] != 0.0) & ~fast
        assert alone.float().mean().item() == pytest.approx(shares.single_axis_share / 3.0, abs=0.01)


def test_commands_stay_in_the_papers_ranges():
    command = drawn(PAPER)
    normal = command[(command[:, 1] != 0.0)]
    for axis, (low, high) in enumerate(NORMAL):
        assert low <= normal[:, axis].min() and normal[:, axis].max() <= high
        assert normal[:, axis].mean().item() == pytest.approx((low + high) / 2.0, abs=0.03)
    assert command[:, 0].max() <= 2.0


def test_half_of_the_fast_commands_turn():
    command = drawn(RECIPE)
    fast = command[(command[:, 0] > 1.0) & (command[:, 1] == 0.0)]
    assert (fast[:, 2] != 0.0).float().mean().item() == pytest.approx(0.5, abs=0.02)
    assert fast[:, 2].abs().max() <= RECIPE.commands.fast_yaw


def test_a_slewed_command_approaches_its_goal_at_the_deployments_rate(bundle):
    changed = {"simulation.num_envs": ENVS, "commands.slew_share": 0.5}
    env = AmpEnvironment(bundle, RECIPE.changed(changed), "cpu", seed=1)
    env.reset()
    term, largest = env.velocity_command, SLEW * env.step_dt
    slewed = torch.isfinite(term._rate[:, 0])
    assert 0 < int(slewed.sum()) < ENVS
    env.start_command[:], env.start_velocity[:] = torch.nan, torch.tensor([0.7, 0.0, -0.2])
    term.restart(torch.ones(ENVS, dtype=torch.bool))
    assert env.command[slewed] == pytest.approx(env.start_velocity[slewed])
    assert torch.equal(env.command[~slewed], term.goal[~slewed])
    goal = term.goal.clone()
    for _ in range(20):
        before = env.command.clone()
        term.compute(env.step_dt)
        way, left = env.command - before, goal - env.command
        assert (way[slewed].abs() <= largest + 1e-6).all()
        assert ((way[slewed].abs() > largest - 1e-5) | (left[slewed].abs() < 1e-6)).all()
    env.start_command[:] = torch.tensor([1.5, 0.0, 0.0])
    term.restart(torch.ones(ENVS, dtype=torch.bool))
    assert env.command == pytest.approx(env.start_command), "the start frame's command is obeyed already"


@pytest.mark.parametrize(("delay_s", "disturbance", "largest"), [(0.0, 1.0, 0), (0.04, 0.0, 0), (0.04, 1.0, 8)])
def test_targets_arrive_as_late_as_the_ramp_allows(bundle, delay_s, disturbance, largest):
    changed = {"simulation.num_envs": 100, "randomization.delay_s": delay_s}
    env = AmpEnvironment(bundle, PAPER.changed({**changed, "simulation.terrain": "plane"}), "cpu", seed=1)
    env.set_disturbance(disturbance)
    env.reset()
    term, given = env.action_manager.get_term("joints"), []
    term._entity = SimpleNamespace(set_joint_position_target=lambda target: given.append(target.clone()))
    joint = int(env.policy_index[0])
    for step in range(1, 4):
        term.process_actions(torch.full((100, 21), float(step)))
        for _ in range(env.cfg.decimation):
            term.apply_actions()
    targets = (torch.stack(given)[:, :, joint] - env.default_joint_pos[joint]) / SCALE
    lags = set()
    for at in range(100):
        lag = int(term._lag[at, 0])
        late = [max(0, (substep - lag) // env.cfg.decimation + 1) for substep in range(len(given))]
        assert targets[:, at].tolist() == pytest.approx([float(step) for step in late], abs=1e-5)
        lags.add(lag)
    assert lags == set(range(largest + 1))
