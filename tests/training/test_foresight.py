"""The critic is told what comes, and what it is told comes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import torch
from tensordict import TensorDict

from pipeline.training.amp_ppo import explained
from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.foresight import AHEAD_S, foreseen, signs
from pipeline.training.mirror import Mirror
from pipeline.training.observations import beyond_signs, critic_frame
from pipeline.training.presets import preset
from pipeline.training.pushes import FORCE_S
from pipeline.training.run import runner_cfg
from tests.factories.training_bundle import small_bundle

ENVS = 6
PUSH_NEAR, PUSH_B, IS_PUSHED, FORCE_B, COMMAND_NEAR, COMMAND = 0, slice(1, 3), 3, slice(4, 6), 6, slice(7, 10)
"""Where in the numbers of a run with pushes as forces."""


@pytest.fixture(scope="module")
def env(tmp_path_factory, root, robot) -> Iterator[AmpEnvironment]:
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("foresight"), root, robot))
    options = preset("long_steps").changed(
        foresight=True,
        push_interval_s=(0.2, 0.3),
        push_iterations=0,
        quiet_share=0.5,
        resample_s=(0.1, 0.3),
        reference_share=0.0,
    )
    env = AmpEnvironment(bundle, options, ENVS, "cpu", seed=1)
    env.reset()
    yield env


def _step(env: AmpEnvironment) -> None:
    with torch.no_grad():
        env.step(torch.zeros(ENVS, 21))


def _turned(vector_b: torch.Tensor, heading_w: torch.Tensor) -> torch.Tensor:
    """From the frame of the heading into the world (n, 2)."""
    cos, sin = heading_w.unbind(dim=1)
    rotation = torch.stack([torch.stack([cos, -sin], dim=1), torch.stack([sin, cos], dim=1)], dim=1)
    return (rotation @ vector_b[..., None])[..., 0]


def test_the_push_that_was_told_comes_when_it_was_told(env: AmpEnvironment):
    env.reset()
    came = 0
    for _ in range(40):
        told, heading = foreseen(env), env.readings.heading_w.clone()
        push_w = _turned(told[:, PUSH_B] / told[:, PUSH_NEAR, None], heading)
        left_s = AHEAD_S * (1.0 - told[:, PUSH_NEAR])
        before = env.trunk_forces.push_w.clone()
        _step(env)
        begins = (left_s <= env.step_dt + 1e-6) & (env.episode_length_buf > 0) & env.pushed
        new = (env.trunk_forces.push_w != before).any(dim=1) & (env.trunk_forces.push_w != 0.0).any(dim=1)
        assert torch.equal(begins, new)
        came += int(new.sum())
        assert FORCE_S * env.trunk_forces.push_w[new, :2] == pytest.approx(push_w[new], abs=1e-3)
    assert came > 5


def test_of_who_is_never_pushed_no_push_is_told(env: AmpEnvironment):
    env.reset()
    _step(env)
    told = foreseen(env)
    assert env.pushed.tolist().count(False) == 3
    assert torch.equal(told[:, IS_PUSHED] > 0.0, env.pushed)
    assert (told[~env.pushed, PUSH_B] == 0.0).all()
    assert (told[env.pushed, PUSH_B].norm(dim=1) > 0.0).all()


def test_the_force_that_acts_is_told_as_it_is_seen_from_the_robot(env: AmpEnvironment):
    env.reset()
    env.trunk_forces.push_w[:] = torch.tensor([30.0, -40.0, 0.0])
    told = foreseen(env)
    assert _turned(told[:, FORCE_B], env.readings.heading_w) == pytest.approx(env.trunk_forces.push_w[:, :2], abs=1e-4)
    assert told[:, FORCE_B].std(dim=0).max() > 1.0, "they face in different directions"


def test_the_command_that_was_told_is_given(env: AmpEnvironment):
    env.reset()
    given = 0
    for _ in range(20):
        told, now = foreseen(env), env.command.clone()
        coming = now + told[:, COMMAND] / told[:, COMMAND_NEAR, None]
        ends = env.velocity_command.time_left <= env.step_dt + 1e-6
        _step(env)
        ends &= env.episode_length_buf > 0
        assert env.command[ends] == pytest.approx(coming[ends], abs=1e-4)
        given += int(ends.sum())
    assert given > 5


def _state(side: float, tracks: bool = False, slopes: bool = True) -> SimpleNamespace:
    """What is read, or seen in a mirror: left and right are the world's second axis, as the robot faces along x."""
    flip, flip2 = torch.tensor([1.0, side, 1.0]), torch.tensor([1.0, side])
    command = torch.tensor([[0.5, 0.3, -1.0], [0.0, 0.2, 0.4]]) * torch.tensor([1.0, side, side])
    coming = torch.tensor([[-0.5, 0.1, 1.0], [1.0, -0.2, 0.1]]) * torch.tensor([1.0, side, side])
    push_w = torch.tensor([[10.0, 20.0, 0], [0, 0, 0]]) * flip
    push = SimpleNamespace(left_s=torch.tensor([1.0, 9.0]), push_w=push_w, since_s=torch.tensor([0.24, math.inf]))
    goal = torch.tensor([[1.0, -0.1, -0.2], [0.0, 0.6, 0.8]]) * torch.tensor([1.0, side, side])
    term = SimpleNamespace(time_left=torch.tensor([0.5, 2.0]), coming=coming, command=command, goal=goal)
    down_w = torch.tensor([[0.1, 0.05, -0.99], [0.0, 0.0, -1.0]]) * flip
    share = 0.5 if slopes else 0.0
    context = SimpleNamespace(options=SimpleNamespace(slew_share=share, rotor_link_share=share, recovery_s=2.0 * share))
    return SimpleNamespace(
        step_dt=0.02,
        context=context,
        rotor_link_share=torch.tensor([0.0, 0.75]),
        command=command,
        slopes=SimpleNamespace(down_w=down_w) if slopes else None,
        coming_pushes=[push],
        readings=SimpleNamespace(heading_w=torch.tensor([[0.8, 0.6], [1.0, 0.0]]) * flip2),
        trunk_forces=SimpleNamespace(push_w=torch.tensor([[5.0, -6.0, 0.0], [1.0, 2.0, 0.0]]) * flip),
        velocity_command=term,
        tracked_clip=SimpleNamespace(tracks=torch.tensor([tracks, False])),
    )


@pytest.mark.parametrize("slopes", [True, False])
def test_in_a_mirror_it_is_seen_with_its_signs(slopes: bool):
    there, mirrored = _state(1.0, slopes=slopes), _state(-1.0, slopes=slopes)
    assert foreseen(there).shape == (2, 17 if slopes else 10)
    assert foreseen(mirrored) == pytest.approx(foreseen(there) * signs(there), abs=1e-6)
    assert (foreseen(mirrored) != foreseen(there)).any()
    assert not slopes or foreseen(there)[:, -2:].flatten().tolist() == pytest.approx([0.0, 0.75, 0.75, 0.0])
    assert (foreseen(there)[1, PUSH_B] == 0.0).all(), "further ahead than is told"


def test_who_tracks_a_clip_is_told_nothing_of_a_command_that_does_not_come():
    told = foreseen(_state(1.0, tracks=True))
    assert (told[0, 6:10] == 0.0).all()
    assert (told[1, 6:10] != 0.0).all()


def test_the_critic_sees_it_the_actor_does_not_and_the_mirror_knows(env: AmpEnvironment):
    env.reset()
    seen = critic_frame(env)
    assert seen.shape == (ENVS, 77 + 10)
    assert torch.equal(seen[:, 77:], foreseen(env))
    assert env.obs_buf["actor"].shape == (ENVS, 720)
    mirror = Mirror(env.context.bundle.robot, "cpu", beyond_signs(env))
    obs = TensorDict({"actor": torch.zeros(ENVS, 720), "critic": seen}, batch_size=[ENVS])
    assert torch.equal(mirror.observations(obs)["critic"][:, 77:], seen[:, 77:] * signs(env))


def test_what_a_critic_explains_of_returns():
    returns = torch.tensor([1.0, 2.0, 3.0, 4.0])
    assert explained(returns, returns) == pytest.approx(1.0)
    assert explained(returns, torch.full((4,), 7.0)) == pytest.approx(0.0)
    assert explained(returns, torch.tensor([1.5, 1.5, 3.5, 3.5])) == pytest.approx(1.0 - (1.0 / 3.0) / (5.0 / 3.0))


@pytest.mark.parametrize("clips", [True, False])
def test_the_clip_of_the_values_is_switched(clips: bool):
    cfg = runner_cfg(preset("paper").changed(value_clip=clips), torch.zeros(1, 4, 60), 21)
    assert cfg["algorithm"]["use_clipped_value_loss"] is clips


def test_who_tracks_a_clip_is_left_alone_where_asked(tmp_path_factory, root, robot):
    bundle = read_bundle(small_bundle(tmp_path_factory.mktemp("left_alone"), root, robot))
    asked = {"push_interval_s": (0.04, 0.06), "push_iterations": 0, "tracked": 0.5, "tracked_end": 0.5}
    for pushed in (True, False):
        env = AmpEnvironment(bundle, preset("long_steps").changed(**asked, tracked_pushed=pushed), ENVS, "cpu", seed=1)
        env.reset()
        clip = env.tracked_clip
        assert clip is not None
        clip.tracks[:] = torch.arange(ENVS) % 2 == 0
        told = (env.coming_pushes[0].push_w != 0.0).any(dim=1)
        assert torch.equal(told, env.pushed & (pushed | ~clip.tracks)), pushed
        acted = torch.zeros(ENVS, dtype=torch.bool)
        for _ in range(3):
            clip.tracks[:] = torch.arange(ENVS) % 2 == 0
            _step(env)
            acted |= (env.trunk_forces.push_w != 0.0).any(dim=1)
        assert torch.equal(acted, told), pushed
