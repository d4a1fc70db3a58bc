"""What is drawn for all environments is taken by the right share of them: pushes and commands."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.action import SCALE
from pipeline.training.bundle import read_bundle
from pipeline.training.commands import ASIDE, FAST, SLEW, SLOW, TURN, draw_commands
from pipeline.training.environment import AmpEnvironment
from pipeline.training.option_texts import changed_by_texts
from pipeline.training.presets import preset
from pipeline.training.pushes import FORCE_S
from tests.factories.training_bundle import small_bundle

ENVS, LATE_ENVS = 6, 100


@pytest.fixture(scope="module")
def env(tmp_path_factory, root, robot) -> Iterator[AmpEnvironment]:
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("draws"), root, robot))
    options = preset("long_steps").changed(push_interval_s=(0.2, 0.3), push_iterations=0, quiet_share=0.0)
    env = AmpEnvironment(bundle, options, ENVS, "cpu", seed=1)
    env.reset()
    yield env


def test_a_force_acts_for_a_tenth_of_a_second_and_ends_with_the_episode(env: AmpEnvironment):
    env.reset()
    trunk, _ = env.scene["robot"].find_bodies(env.context.bundle.robot.root_link)
    lasted, seen = torch.zeros(ENVS, dtype=torch.long), set()
    cut: torch.Tensor | None = None
    for step in range(40):
        if cut is None and step > 20 and bool((lasted == 2).any()):
            cut = lasted == 2
            env.episode_length_buf[:] = env.max_episode_length  # these end while they are pushed
            calm = step + round(0.2 / env.step_dt)  # the shortest wait for another push
        env.step(torch.zeros(ENVS, 21))
        acts = env.scene["robot"].data.body_external_force[:, trunk[0]].norm(dim=1) > 0.0
        new = env.episode_length_buf == 0
        assert not (acts & new).any()
        if cut is not None and step < calm:
            assert not (acts & cut).any()
        seen |= set(lasted[~acts & ~new & (lasted > 0)].tolist())
        lasted = torch.where(acts, lasted + 1, 0)
    assert cut is not None
    assert seen == {round(FORCE_S / env.step_dt)}


@pytest.mark.parametrize(
    ("name", "alone"), [("paper", None), ("long_steps", (0.15, 0.10, 0.10)), ("long_steps", (0.05, 0.20, 0.18))]
)
def test_commands_are_of_each_kind_as_often_as_is_said(name: str, alone):
    options = preset(name) if alone is None else preset(name).changed(alone_shares=alone)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        forward, lateral, yaw = draw_commands(100_000, options, "cpu").T
    stands = (forward == 0.0) & (lateral == 0.0) & (yaw == 0.0)
    fast = (forward >= FAST[0]) & (lateral == 0.0)
    shares = {"stands": (stands, options.standing_share), "fast": (fast, options.fast_share)}
    if alone is not None:
        slow = (forward.abs() + lateral.abs() <= SLOW[1]) & (forward.abs() + lateral.abs() >= SLOW[0])
        shares["slow or on one axis at that speed"] = (
            slow & (yaw == 0.0) & ((forward == 0.0) | (lateral == 0.0)),
            options.slow_share + alone[1] * 0.4 / 1.2 + alone[0] * 0.4 / 1.6,
        )
        shares["turns alone"] = ((forward == 0.0) & (lateral == 0.0) & (yaw != 0.0), alone[2])
    for told, (found, share) in shares.items():
        assert found.float().mean() == pytest.approx(share, abs=0.005), told


@pytest.mark.parametrize(
    ("alone", "told"),
    [
        ("0.05,0.25,0.20", r"alone_shares\[1\] 0\.25, .*1\.05 together"),
        ("0.05,-0.25,0.20", r"alone_shares\[1\] -0\.25"),
        ("0.05,nan,0.20", r"nan together"),
        ("0.05,0.1,0.1,0.1", "must look like"),
        ("0.05", "must look like"),
    ],
)
def test_kinds_of_commands_are_shares_of_all_of_them(alone, told):
    with pytest.raises(TrainingError, match=told):
        changed_by_texts(preset("long_steps"), {"alone_shares": alone})


def test_commands_ahead_are_as_fast_as_is_said_and_half_of_them_straight():
    options = preset("long_steps").changed(ahead_share=0.3, ahead_speeds=(2.1, 2.4), fast_share=0.1)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        command = draw_commands(50_000, options, "cpu")
    ahead = command[command[:, 0] > 2.0]
    assert len(ahead) == pytest.approx(0.3 * 50_000, rel=0.03)
    assert [float(ahead[:, 0].min()), float(ahead[:, 0].max())] == pytest.approx([2.1, 2.4], abs=1e-3)
    assert (ahead[:, 1:] == 0.0).all(dim=1).float().mean() == pytest.approx(0.5, abs=0.02)
    assert ahead[:, 1:].abs().amax(dim=0).tolist() == pytest.approx([ASIDE, TURN], abs=1e-3)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"push_least": "1.2"}, "'push_least' is 1.2; it must be a share"),
        ({"ahead_speeds": "1.5,0.5"}, "'ahead_speeds' is 1.5 to 0.5"),
        ({"ahead_share": "0.9"}, "ahead_share 0.9"),
    ],
)
def test_shares_and_speeds_that_can_not_be_meant_are_refused(changes, told):
    with pytest.raises(TrainingError, match=told):
        changed_by_texts(preset("long_steps"), changes)


def test_kinds_that_are_not_drawn_do_not_count():
    preset("long_steps").changed(alone_shares=(0.05, 0.25, 0.20), mixture="paper")


def test_slewed_commands_come_as_robots_are_told_them(tmp_path_factory, root, robot):
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("slewed"), root, robot))
    options = preset("long_steps").changed(
        slew_share=0.5, resample_s=(0.3, 0.5), reference_share=0.5, reference_command_share=0.0
    )
    env = AmpEnvironment(bundle, options, 20, "cpu", seed=1)
    env.reset()
    term, largest = env.velocity_command, SLEW * env.step_dt
    slewed = torch.isfinite(term._fastest[:, 0])
    assert 0 < int(slewed.sum()) < len(slewed)
    env.own_command[:], env.begun_command[:] = torch.nan, torch.tensor([0.7, 0.0, -0.2])
    term.restart(torch.ones(20, dtype=torch.bool))
    assert env.command[slewed] == pytest.approx(env.begun_command[slewed])
    assert torch.equal(env.command[~slewed], term.goal[~slewed])
    env.own_command[:] = torch.tensor([1.5, 0.0, 0.0])
    term.restart(torch.ones(20, dtype=torch.bool))
    assert env.command == pytest.approx(env.own_command), "that of the frame it begins at is obeyed already"
    ways = []
    for _ in range(30):
        before = env.command.clone()
        env.step(torch.zeros(20, 21))
        same = env.episode_length_buf > 0
        assert torch.equal(env.command[same & ~slewed], term.goal[same & ~slewed])
        way = (env.command - before)[same & slewed]
        assert (way.abs() <= largest + 1e-6).all()
        left = (term.goal - env.command)[same & slewed]
        assert ((way.abs() > largest - 1e-5) | (left.abs() < 1e-6)).all(), "as fast as it may until it is there"
        ways.append(way.abs().max())
    assert max(ways) == pytest.approx(largest, abs=1e-6)


@pytest.mark.parametrize(("share", "begun"), [(0.0, [0.0, 0.0, 0.0]), (1.0, [0.9, 0.1, 0.0])])
def test_a_slewed_command_begins_at_what_the_robot_does(tmp_path_factory, root, robot, share: float, begun: list):
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("begun"), root, robot))
    bundle.expert.command[:] = [0.9, 0.1, 0.0]
    options = preset("long_steps").changed(slew_share=1.0, reference_share=share, reference_command_share=0.0)
    env = AmpEnvironment(bundle, options, 20, "cpu", seed=1)
    env.begun_command[:] = 7.0
    env.reset()
    assert env.begun_command == pytest.approx(torch.tensor(begun).expand(20, 3))
    assert (env.command - env.begun_command).abs().max() <= SLEW * env.step_dt + 1e-6
    assert (env.velocity_command.goal - env.begun_command).abs().max() > 0.1


@pytest.mark.parametrize("largest", [0, 2, 4, 6, 8])
def test_targets_arrive_as_late_as_is_drawn(tmp_path_factory, root, robot, largest: int):
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("late"), root, robot))
    options = preset("paper_flat").changed(action_lag_steps=largest, push_speed=(0.0, 0.0))
    env = AmpEnvironment(bundle, options, LATE_ENVS, "cpu", seed=1)
    env.reset()
    term, given = env.action_manager.get_term("joints"), []
    term._entity = SimpleNamespace(set_joint_position_target=lambda target: given.append(target.clone()))
    joint = int(env.policy_index[0])
    for step in range(1, 4):
        term.process_actions(torch.full((LATE_ENVS, 21), float(step)))
        for _ in range(env.cfg.decimation):
            term.apply_actions()
    told = (torch.stack(given)[:, :, joint] - env.default_joint_pos[joint]) / SCALE
    lags = set()
    for at in range(LATE_ENVS):
        lag = int(term._lag[at, 0])
        late = [max(0, (substep - lag) // env.cfg.decimation + 1) for substep in range(len(given))]
        assert told[:, at].tolist() == pytest.approx([float(step) for step in late], abs=1e-5)
        lags.add(lag)
    assert lags == set(range(largest + 1))


def test_a_delay_that_no_target_is_kept_for_is_refused(tmp_path_factory, root, robot):
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("later"), root, robot))
    with pytest.raises(TrainingError, match="'action_lag_steps' is 9"):
        AmpEnvironment(bundle, preset("paper_flat").changed(action_lag_steps=9), 2, "cpu", seed=1)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_some_pushes_come_straight_from_ahead_or_behind(tmp_path_factory, root, robot, share: float):
    """Of the robot as it faces when the push begins, and not when it was drawn."""
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("sagittal"), root, robot))
    options = preset("long_steps").changed(
        push_sagittal=share, push_interval_s=(0.3, 0.5), push_iterations=0, quiet_share=0.0
    )
    env = AmpEnvironment(bundle, options, 80, "cpu", seed=1)
    env.reset()
    ahead, straight, count = 0, 0, 0
    for _ in range(40):
        env.sim.data.qvel[:, 5] = 2.0  # they turn
        before, (cos, sin) = env.trunk_forces.push_w.clone(), env.readings.heading_w.clone().unbind(dim=1)
        with torch.no_grad():
            env.step(torch.zeros(80, 21))
        (x, y, _), begun = env.trunk_forces.push_w.unbind(dim=1), env.episode_length_buf > 0
        new = begun & (env.trunk_forces.push_w != before).any(dim=1) & (x != 0.0)
        along, aside = x * cos + y * sin, y * cos - x * sin
        straight += int((new & (aside.abs() < 0.1 * along.abs())).sum())
        ahead += int((new & (along > 0.0)).sum())
        count += int(new.sum())
    assert count > 60 and 0.3 * count < ahead < 0.7 * count
    assert straight / count == pytest.approx(share, abs=0.15) if share < 1.0 else straight == count
