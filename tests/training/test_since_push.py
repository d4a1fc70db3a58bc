"""How long ago a robot was last pushed."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
import torch

from pipeline.training.pushes import ComingPush, since_push


def pushed_env(pushed: tuple[bool, ...], *kinds_m_s: float) -> SimpleNamespace:
    """A stand-in whose robots are pushed by each kind in turn, at .1 s, .2 s and so on."""
    env = SimpleNamespace(num_envs=len(pushed), device="cpu", step_dt=0.02, pushed=torch.tensor(pushed))
    options = SimpleNamespace(push_interval_s=(5.0, 5.0), push_least=0.2, push_sagittal=0.0, tracked_pushed=True)
    env.context, env.readings, env.tracked_clip = SimpleNamespace(options=options), SimpleNamespace(), None
    env.coming_pushes, env.restarts = [], []
    for kind, largest in enumerate(kinds_m_s):
        ComingPush(env, torch.tensor(largest)).left_s[:] = 0.1 * (kind + 1) - 0.01
    return env


def test_the_time_since_a_push_is_that_of_the_latest_of_any_kind():
    env = pushed_env((True, False), 1.0, 2.0)
    found = []
    for _ in range(15):
        for coming in env.coming_pushes:
            coming.begins()
        found.append(since_push(env)[0].item())
        assert since_push(env)[1] == math.inf
    assert found[:4] == [math.inf] * 4
    wanted = [0.02 * (step % 5) for step in range(10)] + [0.1]
    assert found[4:] == pytest.approx(wanted, abs=1e-6)
    for restart in env.restarts:
        restart(torch.tensor([True, False]))
    assert since_push(env).tolist() == [math.inf] * 2


def test_without_pushes_the_time_since_one_is_without_end():
    assert since_push(pushed_env((True, True, True))).tolist() == [math.inf] * 3


def test_a_push_of_nothing_is_none():
    env = pushed_env((True,), 0.0)
    for _ in range(8):
        env.coming_pushes[0].begins()
    assert since_push(env).tolist() == [math.inf]
