"""When episodes end: falls, and commands that are ignored."""

from __future__ import annotations

import pytest
import torch
from scipy.spatial.transform import Rotation

from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.environment import AmpEnvironment
from pipeline.training.mdp.terminations import ended_by, fell, ignores_command
from tests.factories.given_command import give_command
from tests.factories.training_bundle import small_bundle

CASES = [
    ((1.0, 0.0, 0.0), (0.2, 0.0, 0.0), True),
    ((1.0, 0.0, 0.0), (0.4, 0.0, 0.0), False),
    ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), True),
    ((0.1, 0.0, 0.0), (0.0, 0.0, 0.0), False),
    ((0.0, 0.0, -1.0), (0.0, 0.0, -0.1), True),
    ((0.0, 0.0, -1.0), (0.0, 0.0, -0.5), False),
    ((1.0, 0.0, 1.0), (0.9, 0.0, 0.0), True),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False),
]


@pytest.mark.parametrize(("command", "velocity", "ignored"), CASES)
def test_a_command_is_ignored_where_one_half_of_it_is(command, velocity, ignored):
    assert ignores_command(torch.tensor([command]), torch.tensor([velocity])).item() is ignored


def test_a_tilted_or_diverged_robot_fell_and_a_stall_is_no_fall(tmp_path, root, robot):
    config = RECIPE.changed({"simulation.num_envs": 5, "simulation.stall_s": 0.1, "simulation.reference_share": 0.0})
    env = AmpEnvironment(read_bundle(small_bundle(tmp_path, root, robot)), config, "cpu", seed=1)
    env.reset()
    give_command(env, torch.arange(5), torch.tensor([0.0, 0.0, 0.0]))
    env.sim.data.qpos[1, 3:7] = torch.tensor([0.6, 0.8, 0.0, 0.0])
    env.sim.data.qvel[3, 2] = float("nan")
    give_command(env, torch.tensor([4]), torch.tensor([1.5, 0.0, 0.0]), age_s=5.0)
    fallen, stalled = torch.zeros(5, dtype=torch.bool), torch.zeros(5, dtype=torch.bool)
    for _ in range(8):
        env.step(torch.zeros(5, 21))
        fallen |= fell(env)
        stalled |= ended_by(env, "stalled")
        assert torch.isfinite(env.reward_buf).all()
    assert fallen.tolist() == [False, True, False, True, False]
    assert stalled[4] and not stalled[0]
    assert torch.isfinite(env.sim.data.qpos[:]).all(), "episodes that ended begin again"


def test_a_robot_that_leans_by_70_degrees_fell_and_by_50_did_not(tmp_path, root, robot):
    config = RECIPE.changed({"simulation.num_envs": 8, "pushes.kick_m_s": (0.0, 0.0), "pushes.impulse_n_s": (0.0, 0.0)})
    env = AmpEnvironment(read_bundle(small_bundle(tmp_path, root, robot)), config, "cpu", seed=1)
    env.reset()
    for row, (axis, lean_deg) in enumerate((a, d) for a in ("x", "y") for d in (50.0, -50.0, 70.0, -70.0)):
        x, y, z, w = Rotation.from_euler(axis, lean_deg, degrees=True).as_quat()
        env.sim.data.qpos[row, 3:7] = torch.tensor([w, x, y, z])
    env.sim.data.qpos[:, 2] += 1.0  # in the air
    env.sim.data.qvel[:] = 0.0
    env.step(torch.zeros(8, 21))
    assert fell(env).tolist() == [False, False, True, True] * 2
