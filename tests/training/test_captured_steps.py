"""Captured parts do the same work on the same memory at every step, without GPU synchronization.

Checked on a CPU by PyTorch's calls. That a replayed part computes what the called part does can only be checked on a
GPU (`benchmarks/captured_steps.py`); so can a Python number that becomes a tensor, which can't be recorded there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
import torch
from mjlab.envs import ManagerBasedRlEnv
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten

from pipeline.training.bundle import read_bundle
from pipeline.training.captured import Captured
from pipeline.training.config import PAPER, RECIPE
from pipeline.training.distillation.teacher import ClipTeacher
from pipeline.training.environment import AmpEnvironment
from tests.factories.training_bundle import small_bundle

ENVS = 6
WAITS = ("nonzero", "_local_scalar_dense", "masked_select", "unique", "is_nonzero")
"""Calls whose result's size or value must be known before the next call."""
PARTS = ("_evaluate", "_reset_done", "_update_observations", "_update_velocity")


class Calls(TorchDispatchMode):
    """What is called: each with its numbers, and with where its tensors come from: made by an earlier call of the step,
    or at an address."""

    def __init__(self):
        super().__init__()
        self.made: dict[int, tuple[str, int]] = {}
        self.kept: list[torch.Tensor] = []
        """So that no address is used twice."""
        self.calls: list[tuple] = []
        self.waits: list[str] = []

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        given, _ = tree_flatten((args, kwargs or {}))
        if "lift_fresh" in str(func) and not given[0].ndim:  # a number, given as one
            self.made[_address(given[0])] = (f"number {given[0].item()}", 0)
            self.kept.append(given[0])
            return func(*args, **(kwargs or {}))
        self.calls.append((str(func), *(self._source(each) for each in given)))
        by_mask = [each for each in given if isinstance(each, torch.Tensor) and each.dtype == torch.bool]
        if (
            any(name in str(func) for name in WAITS)
            or ("aten.index" in str(func) and by_mask)
            or "lift_fresh" in str(func)  # `torch.tensor` of a list: a copy from the processor
        ):
            self.waits.append(str(func))
        result = func(*args, **(kwargs or {}))
        taken = {_address(each) for each in given if isinstance(each, torch.Tensor)}
        for number, each in enumerate(tree_flatten(result)[0]):
            if isinstance(each, torch.Tensor) and _address(each) not in taken:
                self.made[_address(each)] = (f"call {len(self.calls)}", number)
                self.kept.append(each)
        return result

    def _source(self, given: Any) -> Any:
        if not isinstance(given, torch.Tensor):
            return repr(given)
        at = _address(given)
        return (self.made.get(at, f"address {at}"), tuple(given.shape), given.storage_offset())


def _address(tensor: torch.Tensor) -> int:
    return tensor.untyped_storage().data_ptr()


def recorded(parts: list[Captured], steps: list[Callable[[], None]]) -> list[Calls]:
    """What the parts call in each of the steps."""
    works, found = [part._function for part in parts], []
    for step in steps:
        calls = Calls()

        def within(work: Callable[[], None], calls: Calls = calls) -> Callable[[], None]:
            def watched() -> None:
                with calls:
                    work()

            return watched

        for part, work in zip(parts, works, strict=True):
            part._function = within(work)
        step()
        found.append(calls)
    for part, work in zip(parts, works, strict=True):
        part._function = work
    return found


def differences(one: Calls, other: Calls) -> list[tuple]:
    """Calls that are not alike."""
    if len(one.calls) != len(other.calls):
        return [(len(one.calls), len(other.calls))]
    return [(a, b) for a, b in zip(one.calls, other.calls, strict=True) if a != b]


OFTEN = {
    "simulation.num_envs": ENVS,
    "pushes.interval_s": (0.02, 0.04),
    "pushes.kick_m_s": (0.0, 1.0),
    "discriminator.style": 0.0,
}
CONFIGS = {
    "recipe": RECIPE.changed(OFTEN),
    "paper": PAPER.changed({**OFTEN, "simulation.terrain": "plane"}),
    "rough": PAPER.changed({"simulation.num_envs": ENVS}),
}


@pytest.fixture(scope="module", params=[*CONFIGS, "distillation"])
def env(request, tmp_path_factory, root, robot) -> Iterator[AmpEnvironment]:
    distils = request.param == "distillation"
    bundle = read_bundle(
        small_bundle(tmp_path_factory.mktemp("captured"), root, robot, tracker="passive" if distils else "")
    )
    if distils:
        config = CONFIGS["recipe"]
        assert bundle.teacher is not None
        teacher = ClipTeacher(bundle.teacher, bundle.robot, config, "cpu")
        env = AmpEnvironment(bundle, config, "cpu", seed=1, teacher=teacher, starts=teacher.starts(1))
    else:
        env = AmpEnvironment(bundle, CONFIGS[request.param], "cpu", seed=1)
    env.reset()
    yield env


def test_every_step_is_the_same_work_on_the_same_memory(env: AmpEnvironment):
    parts = [*env._targets, *(getattr(env, name) for name in PARTS)]

    def eight(ends: int) -> Callable[[], None]:
        def steps() -> None:
            env.episode_length_buf[:ends] = env.max_episode_length
            for step in range(8):
                if step == 3:
                    env.set_disturbance(ends / ENVS)
                env.step(torch.randn(ENVS, 21))

        return steps

    with torch.no_grad():
        env.step(torch.zeros(ENVS, 21))
        while env.common_step_counter % 8:
            env.step(torch.zeros(ENVS, 21))
        first, second, third = recorded(parts, [eight(0), eight(3), eight(ENVS)])
    assert len(first.calls) > 8 * 400
    assert not first.waits + second.waits + third.waits
    assert not differences(first, second)[:1]
    assert not differences(second, third)[:1]


class Careless:
    """Work as a part must not be."""

    def __init__(self):
        self.state, self.number, self.seen = torch.zeros(3), 0.0, torch.zeros(())

    def bound_anew(self) -> None:
        self.state = self.state + 1.0

    def a_number(self) -> None:
        self.number += 1.0
        self.seen.fill_(self.number)

    def sometimes(self) -> None:
        self.number += 1.0
        if self.number > 1.5:
            self.seen.zero_()

    def waits(self) -> None:
        self.state[self.state > 0.0].sum()


@pytest.mark.parametrize("name", ["bound_anew", "a_number", "sometimes"])
def test_work_that_differs_at_the_next_step_is_found(name: str):
    part = Captured(getattr(Careless(), name), "cpu")
    first, second, third = recorded([part], [part, part, part])
    assert differences(first, second) + differences(second, third)


def test_work_that_waits_is_found():
    part = Captured(Careless().waits, "cpu")
    assert recorded([part], [part])[0].waits


def test_what_a_step_returns_is_not_written_over_by_the_next(env: AmpEnvironment):
    env.reset()
    observation, *_ = env.step(torch.randn(ENVS, 21))
    seen = cast(torch.Tensor, observation["actor"])
    before = seen.clone()
    cast(torch.Tensor, env._groups["actor"]).add_(1.0)  # as a replay does
    assert torch.equal(seen, before)


def test_a_step_is_the_one_of_mjlab(tmp_path, root, robot):
    """With nothing drawn at random in it, and no episode that ends."""
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    calm = {"randomization.noise": 0.0, "randomization.delay_s": 0.0, "simulation.reference_share": 0.0}
    calm |= {"pushes.kick_m_s": (0.0, 0.0), "pushes.impulse_n_s": (0.0, 0.0), "simulation.num_envs": 3}
    found: list[list[torch.Tensor]] = []
    for step in (ManagerBasedRlEnv.step, AmpEnvironment.step):
        env = AmpEnvironment(bundle, RECIPE.changed(calm), "cpu", seed=4)
        env.reset(seed=4)
        given = torch.Generator().manual_seed(5)
        values = []
        if step is ManagerBasedRlEnv.step:
            _advance_before_terminations(env)
        for _ in range(10):
            observation, reward, ended, *_ = step(env, 0.3 * torch.randn(3, 21, generator=given))
            env.robot_state.invalidate()
            assert not ended.any()
            values += [cast(torch.Tensor, observation[name]).clone() for name in ("actor", "critic")]
            values += [reward.clone(), env.positions(), env.velocity_command.age.clone()]
        found.append(values)
    assert max(each.abs().max() for each in found[0]) > 1.0
    for mjlabs, ours in zip(*found, strict=True):
        assert ours.numpy() == pytest.approx(mjlabs.numpy(), abs=1e-5)


def _advance_before_terminations(env: AmpEnvironment) -> None:
    """Let mjlab's step update the averaged velocity where ours does."""
    compute = env.termination_manager.compute

    def advanced() -> torch.Tensor:
        env.robot_state.advance()
        return compute()

    env.termination_manager.compute = advanced


NEVER_DRAWN = 77
"""More than any state that is drawn at the start of an episode, such as a delay of up to 8 physics steps."""


def test_an_episode_begins_only_where_one_ended(env: AmpEnvironment):
    """Everything that a term keeps of an episode is another, or as at the start of one, and no other is touched."""
    torch.manual_seed(11)
    env.reset()
    for _ in range(3):
        env.step(0.1 * torch.randn(ENVS, 21))
    lives = (env.episode_length_buf == 3).nonzero()[:, 0]
    assert len(lives) >= 4, "an episode that ended by itself has begun again already"
    ended = lives[:2].tolist()
    others = [number for number in range(ENVS) if number not in ended]
    for value in _kept(env).values():
        value[:] = NEVER_DRAWN
    env.ended_steps[:] = 5
    timers = [push._timer for push in _pushes(env)]
    left = [timer._left_s.clone() for timer in timers]
    before = {name: value.clone() for name, value in (_states(env) | _kept(env)).items()}
    env._reset_idx(torch.tensor(ended))
    for name, value in (_states(env) | _kept(env)).items():
        assert torch.equal(value[others], before[name][others]), name
        for number in ended:
            assert not torch.equal(value[number], before[name][number]), name
    assert (env.episode_length_buf[ended] == 0).all()
    assert (env.ended_steps[ended] == NEVER_DRAWN).all()
    for timer, left_s in zip(timers, left, strict=True):
        assert torch.equal(timer._left_s, left_s), "pushes keep their times across episodes"
    height = env.sim.data.qpos[ended, 2]
    assert ((height > 0.5) & (height < 0.9)).all()


def _states(env: AmpEnvironment) -> dict[str, torch.Tensor]:
    """What is drawn again, never the same twice."""
    return {
        "qpos": env.sim.data.qpos[:],
        "qvel": env.sim.data.qvel[:],
        "time": env.sim.data.time[:],
        "time_left": env.velocity_command.time_left,
        "mean velocity": env.robot_state.mean_velocity,
    }


def _pushes(env: AmpEnvironment) -> list:
    return [env.event_manager.get_term_cfg(name).func for name in ("push", "kick") if name in env.cfg.events]


def _kept(env: AmpEnvironment) -> dict[str, torch.Tensor]:
    """What may be set to anything before, and is not that after."""
    action = env.action_manager.get_term("joints")
    terms = [env.observation_manager.get_term_cfg("actor", "history").func, action]
    if "stalled" in env.termination_manager.active_terms:
        terms.append(env.termination_manager.get_term_cfg("stalled").func)
    terms += _pushes(env)
    named = ["_frames", "_raw", "_target", "_before", "_seconds", "_left_s"]
    named += ["_lag"] if env.context.config.randomization.delay_s else []
    found = {
        f"{type(term).__name__}{number}.{name}": getattr(term, name)
        for number, term in enumerate(terms)
        for name in named
        if hasattr(term, name)
    }
    if env.teacher is not None:
        teacher = cast(ClipTeacher, env.teacher)
        found |= {name: getattr(teacher, name) for name in ("path_xy", "yaw_offset", "_last_action")}
    return found | {
        "push": env.push_w,
        "length": env.episode_length_buf,
        "ended steps": env.ended_steps,
        "action": env.action_manager.action,
        "action before": env.action_manager.prev_action,
        "command": env.command,
        "goal of the command": env.velocity_command.goal,
        "start velocity": env.start_velocity,
        "age of the command": env.velocity_command.age,
        "own command": env.start_command,
        "stance": env.robot_state._phase_s,
    }
