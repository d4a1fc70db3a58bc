"""No mask of ours selects, counts or is asked for a number in a step, for which a processor would wait for its GPU; and
what is drawn for all instead is taken by the right share.

Copies to and from a GPU can't be seen here: there is none.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from pipeline.training.bundle import read_bundle
from pipeline.training.commands import FAST, SLOW, draw_commands
from pipeline.training.environment import AmpEnvironment
from pipeline.training.presets import preset
from pipeline.training.pushes import FORCE_S
from tests.factories.training_bundle import small_bundle

ENVS = 6
WAITS = ("nonzero", "_local_scalar_dense", "masked_select")
"""Their result's size or value has to be known before the next call."""


def _caller() -> str:
    """File that called PyTorch."""
    frame = sys._getframe(2)
    while frame.f_back is not None and ("/torch/" in frame.f_code.co_filename or "<" in frame.f_code.co_filename):
        frame = frame.f_back
    return frame.f_code.co_filename


class Waits(TorchDispatchMode):
    """Counts calls that would wait for a GPU, by the file of ours that made them."""

    def __init__(self):
        super().__init__()
        self.found: Counter[str] = Counter()

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        indices = args[1] if "aten.index" in str(func) and isinstance(args[1], (list, tuple)) else ()
        by_mask = any(isinstance(each, torch.Tensor) and each.dtype == torch.bool for each in indices)
        caller = _caller()
        if "pipeline/training" in caller and (by_mask or any(name in str(func) for name in WAITS)):
            self.found[f"{caller}: {func}"] += 1
        return func(*args, **(kwargs or {}))


@pytest.fixture(scope="module")
def env(tmp_path_factory, root, robot) -> Iterator[AmpEnvironment]:
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("waiting"), root, robot))
    options = preset("long_steps").changed(push_interval_s=(0.2, 0.3), push_iterations=0, quiet_share=0.0)
    env = AmpEnvironment(bundle, options, ENVS, "cpu", seed=1)
    env.reset()
    yield env


def test_a_mask_that_selects_is_told():
    waits = Waits()
    with waits:
        exec(compile("mask = torch.ones(3) > 0; mask.nonzero(); torch.ones(3)[mask]", "pipeline/training/x.py", "exec"))
    assert sum(waits.found.values()) == 2


def test_no_step_waits_for_what_we_ask_also_not_when_episodes_end(env: AmpEnvironment):
    ended, waits = 0, Waits()
    env.step(torch.zeros(ENVS, 21))
    for step in range(20):
        if step in (5, 15):
            env.episode_length_buf[:] = env.max_episode_length
        with waits:
            env.step(torch.randn(ENVS, 21))
        ended += int(env.reset_buf.sum())
    assert ended >= 2 * ENVS
    assert not waits.found


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


@pytest.mark.parametrize("name", ["paper", "long_steps"])
def test_commands_are_of_each_kind_as_often_as_is_said(name: str):
    options = preset(name)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        forward, lateral, yaw = draw_commands(100_000, options, "cpu").T
    balanced = options.mixture == "balanced"
    stands = (forward == 0.0) & (lateral == 0.0) & (yaw == 0.0)
    fast = (forward >= FAST[0]) & (lateral == 0.0)
    shares = {"stands": (stands, options.standing_share), "fast": (fast, options.fast_share)}
    if balanced:
        slow = (forward.abs() + lateral.abs() <= SLOW[1]) & (forward.abs() + lateral.abs() >= SLOW[0])
        shares["slow or on one axis at that speed"] = (
            slow & (yaw == 0.0) & ((forward == 0.0) | (lateral == 0.0)),
            options.slow_share + 0.10 * 0.4 / 1.2 + 0.15 * 0.4 / 1.6,
        )
        shares["turns alone"] = ((forward == 0.0) & (lateral == 0.0) & (yaw != 0.0), 0.10)
    for told, (found, share) in shares.items():
        assert found.float().mean() == pytest.approx(share, abs=0.005), told
