"""While a push is caught effort, or steps too, cost nothing; all else costs what it does, and everybody else pays."""

from __future__ import annotations

import math

import pytest
import torch

from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.presets import preset
from pipeline.training.pushes import recovery_left
from tests.factories.training_bundle import small_bundle

ENVS = 6
RECOVERY_S = 0.1
EFFORT = ("power", "power_share", "saturation")
FREE = {"effort": EFFORT, "steps": (*EFFORT, "feet_slide", "standing_still")}


def _environment(tmp_path, root, robot, **changed) -> AmpEnvironment:
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    asked = {"push_interval_s": (0.24, 0.3), "push_iterations": 0, "quiet_share": 0.5, "quiet_pushed": 0.0}
    asked |= {"power": 0.01, "power_share": 1.0, "saturation": 10.0, "reference_share": 0.0, "foresight": True}
    asked |= {"late_iterations": (-1, 0)}
    env = AmpEnvironment(bundle, preset("long_steps").changed(**asked | changed), ENVS, "cpu", seed=1)
    env.reset()
    return env


def _step(env: AmpEnvironment) -> None:
    with torch.no_grad():
        env.step(torch.zeros(ENVS, 21))


@pytest.mark.parametrize("recovery_of", FREE)
def test_what_is_free_costs_nothing_for_as_long_after_a_push_as_is_asked(tmp_path, root, robot, recovery_of):
    env = _environment(tmp_path, root, robot, recovery_s=RECOVERY_S, recovery_of=recovery_of)
    env.velocity_command.give(torch.arange(ENVS), torch.zeros(ENVS, 3))
    task = env.reward_manager.get_term_cfg("task").func
    effort = torch.tensor([row.name in FREE[recovery_of] for row in task.rows])
    assert effort.sum() == len(FREE[recovery_of])
    found, values = [], task.values
    task.values = lambda env: found.append(values(env)) or found[-1]
    steps_since = torch.full((ENVS,), 1000)
    free_steps, before = 0, env.trunk_forces.push_w.clone()
    for _ in range(40):
        _step(env)
        steps_since += 1
        free = steps_since <= round(RECOVERY_S / env.step_dt)
        due = torch.nan_to_num(found[-1]) * task.weights(env)
        assert (due[:, effort].sum(dim=1) < 0.0).all()
        assert torch.equal(task.paid, torch.where(free[:, None] & effort, 0.0, due))
        assert torch.allclose(env.reward_buf, task.paid.sum(dim=1) * env.step_dt)
        free_steps += int(free.sum())
        steps_since[env.episode_length_buf == 0] = 1000
        force = env.trunk_forces.push_w
        begins = (force != before).any(dim=1) & (force != 0.0).any(dim=1)
        steps_since[begins], before = 0, force.clone()
    assert free_steps > 20
    assert (recovery_left(env, RECOVERY_S)[~env.pushed] == 0.0).all()


def test_the_latest_push_of_any_kind_is_recovered_from_but_none_of_the_episode_before(tmp_path, root, robot):
    env = _environment(tmp_path, root, robot, recovery_s=5.0, push_speed=(0.5, 0.5))
    begun = [0, 0]
    for _ in range(16):
        _step(env)
        for kind, push in enumerate(env.coming_pushes):
            now = push.since_s == 0.0
            assert (recovery_left(env, 5.0)[now] > 0.99).all()
            begun[kind] += int(now.sum())
    assert min(begun) > 0
    env.reset()
    assert [push.since_s.tolist() for push in env.coming_pushes] == [[math.inf] * ENVS] * 2
    assert (recovery_left(env, 5.0) == 0.0).all()


def test_a_push_of_nothing_is_none_to_recover_from(tmp_path, root, robot):
    env = _environment(tmp_path, root, robot, recovery_s=5.0, push_impulse=(0.0, 0.0))
    for _ in range(20):
        _step(env)
    assert (recovery_left(env, 5.0) == 0.0).all()
