"""MuJoCo in threads in the place of MuJoCo Warp: the same steps, each environment with its own model and state."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.environment import AmpEnvironment
from tests.factories.training_bundle import small_bundle

ENVS = 6
DRAWN = RECIPE.changed({"randomization.rotor_link_share": 0.7, "randomization.friction": (0.1, 1.2)})
"""Everything in which environments differ."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("training"), root, robot))


def made(bundle, physics: str, count: int = ENVS) -> AmpEnvironment:
    torch.manual_seed(6)
    env = AmpEnvironment(bundle, DRAWN.changed({"simulation.num_envs": count}), "cpu", 6, physics)
    env.set_disturbance(1.0)
    env.reset()
    return env


def walked(env: AmpEnvironment, steps: int) -> list[dict[str, torch.Tensor]]:
    """What each of some steps with the same drawn actions shows."""
    draws = torch.Generator().manual_seed(1)
    torch.manual_seed(7)  # of noise, pushes and commands
    found = []
    for _ in range(steps):
        obs, reward, *_ = env.step(0.3 * torch.randn(env.num_envs, 21, generator=draws))
        data = env.sim.data
        found.append(
            {
                "seen": obs["actor"],
                "critic": obs["critic"],
                "reward": reward.clone(),
                "torque": data.qfrc_actuator[:].clone(),
                "links": data.xpos[:].clone(),
                "turns": data.xmat[:].clone(),
                "force": data.sensordata[:].clone(),
            }
        )
    return found


@pytest.fixture(scope="module")
def both(bundle):
    return {name: made(bundle, name) for name in ("warp", "plain")}


def test_both_engines_step_alike(both):
    """Eight control steps of robots that differ in friction, masses, rotors and slopes, some of them pushed or falling.

    Float32 and an iterative solver leave 1e-4; contacts are stiff, their forces are held to 1 % of the weight.
    """
    pairs = zip(walked(both["warp"], 8), walked(both["plain"], 8), strict=True)
    for step, (warp, plain) in enumerate(pairs):
        for name, limit in {"links": 2e-5, "turns": 2e-4, "seen": 5e-3, "reward": 1e-4, "torque": 0.05}.items():
            off = (warp[name] - plain[name]).abs().reshape(ENVS, -1).amax(dim=1)
            assert off.max() < limit, (step, name, off)
        assert (warp["force"] - plain["force"]).abs().max() < 3.0, step


def test_environments_have_models_of_their_own(both):
    env = both["plain"]
    for name in ("geom_friction", "body_mass", "body_inertia", "dof_armature", "dof_invweight0", "body_subtreemass"):
        found = torch.as_tensor(np.stack([getattr(model, name) for model in env.sim._models])).float()
        field = getattr(env.sim.model, name)[:].reshape(found.shape)
        torch.testing.assert_close(field, found, rtol=1e-6, atol=1e-9)
        assert (found.std(dim=0) > 0.0).any(), name
        warp = getattr(both["warp"].sim.model, name)[:].reshape(found.shape)
        torch.testing.assert_close(field, warp, rtol=1e-3, atol=1e-6)
    down = torch.as_tensor(np.stack([model.opt.gravity for model in env.sim._models])).float()
    torch.testing.assert_close(down / 9.81, env.slopes.down_w)


def test_a_field_that_changes_later_counts(bundle):
    env = made(bundle, "plain")
    env.sim.model.body_mass[2] *= 3.0
    env.sim.data.qvel[:] = 0.0
    before = [model.body_mass.sum() for model in env.sim._models]
    env.sim.forward()
    after = np.array([model.body_mass.sum() for model in env.sim._models]) / before
    assert after[2] == pytest.approx(3.0)
    assert (np.delete(after, 2) == 1.0).all()


def test_a_state_written_by_the_user_is_simulated_from_there(bundle):
    env = made(bundle, "plain")
    walked(env, 2)
    env.sim.data.qpos[1, 2] += 5.0
    env.sim.data.qvel[1] = 0.0
    env.sim.data.xfrc_applied[3, env.robot_state._root, 0] = 200.0
    others = env.sim.data.qvel[:, 0].clone()
    env.sim.data.ctrl[:] = 0.0
    env.sim.step()
    assert env.sim.data.qvel[1, 2] == pytest.approx(-9.81 * 0.005 * -float(env.slopes.down_w[1, 2]), abs=1e-3)
    gained = env.sim.data.qvel[:, 0] - others
    assert gained[3] > 0.02


def test_a_reset_changes_only_the_selected_environments(bundle):
    env = made(bundle, "plain")
    walked(env, 3)
    before = {name: getattr(env.sim.data, name)[:].clone() for name in ("qpos", "qvel", "qacc", "sensordata", "time")}
    for name in ("xfrc_applied", "ctrl", "qfrc_applied"):
        getattr(env.sim.data, name)[:] = 1.0
    env.sim.forward()
    before = {name: getattr(env.sim.data, name)[:].clone() for name in before}
    env.sim.reset(torch.tensor([False, True] + [False] * (ENVS - 2)))
    default = torch.from_numpy(env.sim.mj_model.qpos0).float()
    for name, was in before.items():
        now = getattr(env.sim.data, name)[:]
        assert torch.equal(now[[0, *range(2, ENVS)]], was[[0, *range(2, ENVS)]])
        assert torch.equal(now[1], default if name == "qpos" else torch.zeros_like(now[1])), name
    for name in ("xfrc_applied", "ctrl", "qfrc_applied"):
        given = getattr(env.sim.data, name)
        assert (given[1] == 0.0).all() and (given[0] == 1.0).all(), name
    env.sim.data.ctrl[1] = 1.0  # as before: it counts all the same
    env.sim.forward()
    assert (env.sim.data.qfrc_actuator[1, 6:] == 1.0).all()


def test_the_same_run_has_the_same_bits_whatever_the_threads(bundle):
    first, again = made(bundle, "plain"), made(bundle, "plain")
    again.sim._parts = [range(ENVS)]
    for one, other in zip(walked(first, 6), walked(again, 6), strict=True):
        assert all(torch.equal(one[name], other[name]) for name in one)


def test_between_control_steps_only_what_is_read_is_written(bundle, monkeypatch):
    less, more = made(bundle, "plain"), made(bundle, "plain")
    monkeypatch.setattr(more, "_step_between", more.sim.step)
    for one, other in zip(walked(less, 6), walked(more, 6), strict=True):
        assert all(torch.equal(one[name], other[name]) for name in one)


def test_one_environment_alone(bundle):
    env = made(bundle, "plain", count=1)
    assert torch.isfinite(walked(env, 3)[-1]["seen"]).all()


def test_a_diverged_robot_stays_diverged(bundle):
    """MuJoCo alone resets a robot whose acceleration is not finite; here, as in Warp, none is reset."""
    env = made(bundle, "plain")
    env.sim.data.qvel[2] = float("nan")
    env.sim.step()
    assert env.sim.data.qpos[2].isnan().any()
    assert torch.isfinite(env.sim.data.qpos[[0, 1, 3, 4, 5]]).all()


def test_a_gpu_is_not_given_to_threads(bundle):
    with pytest.raises(TrainingError, match="--physics is 'plain'"):
        AmpEnvironment(bundle, DRAWN, "cuda:0", 5, "plain")
