"""The environment against independent figures: reflection, velocities, noise, the torque-speed line."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from mjlab.actuator.actuator import ActuatorCmd
from mjlab.utils.lab_api.math import quat_apply_inverse
from tensordict import TensorDict

from pipeline.expert.frames import expert_frames
from pipeline.learning.robot_entity import LineMotor
from pipeline.robot import Robot
from pipeline.robot.mirror_image import mirror_clip
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.training.amp.symmetry import Mirror
from pipeline.training.bundle import Bundle, read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.environment import AmpEnvironment
from pipeline.training.mdp import rewards
from pipeline.training.mdp.observations import critic_frame
from pipeline.training.mdp.start_states import StartStates
from tests.factories.robot_clips import wandering
from tests.factories.training_bundle import small_bundle
from tests.training.test_environment import ENVS, QUIET, put

MANY = 40
"""Environments whose spread shows a range."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory, root: Path, robot: Robot) -> Bundle:
    return read_bundle(small_bundle(tmp_path_factory.mktemp("training"), root, robot))


def made(bundle: Bundle, **changed: Any) -> AmpEnvironment:
    """A quiet environment with other options, its first episodes begun."""
    options = {name.replace("__", "."): value for name, value in changed.items()}
    env = AmpEnvironment(bundle, RECIPE.changed({**QUIET, **options}), "cpu", seed=1)
    env.reset()
    return env


def test_a_mirrored_observation_is_that_of_the_reflected_robot(bundle: Bundle, robot: Robot):
    env = made(bundle)
    mirror, seen = Mirror(bundle.robot, "cpu"), []
    command = torch.tensor([0.5, 0.2, -0.7])
    for clip, sign in ((wandering(robot), 1.0), (mirror_clip(wandering(robot), robot, "image"), -1.0)):
        put(env, expert_frames(clip, robot)[[5, 30, 60, 90]].astype(np.float32))
        env.robot_state.restart(torch.ones(ENVS, dtype=torch.bool))
        env.velocity_command._command[:] = command * torch.tensor([1.0, sign, sign])
        env.robot_state.invalidate()
        seen.append(critic_frame(env))
    both = TensorDict({"actor": torch.zeros(ENVS, 720), "critic": seen[0]}, batch_size=[ENVS])
    torch.testing.assert_close(mirror.observations(both)["critic"], seen[1], atol=2e-3, rtol=0.0)


def test_trunk_penalties_use_vertical_speed_and_roll_and_pitch_rates():
    state = SimpleNamespace(lin_vel_b=torch.tensor([[1.0, 2.0, 3.0]]), ang_vel_b=torch.tensor([[1.0, 2.0, 4.0]]))
    given: Any = SimpleNamespace(robot_state=state)
    assert rewards.lin_vel_z_l2(given).item() == 9.0
    assert rewards.ang_vel_xy_l2(given).item() == 5.0


def test_an_episode_that_is_over_is_no_fall(bundle: Bundle):
    env = made(bundle)
    env.episode_length_buf[:] = env.max_episode_length
    *_, ended, timed_out, _ = env.step(torch.zeros(ENVS, 21))
    assert timed_out.all() and not ended.any()


def test_a_start_has_the_velocities_of_its_frame_in_the_robots_axes(bundle: Bundle, monkeypatch: pytest.MonkeyPatch):
    env = made(bundle, simulation__reference_share=1.0)
    at = torch.tensor([120, 140, 160, 180])
    monkeypatch.setattr(StartStates, "draw", lambda self, count: (at, torch.full((count, 3), torch.nan)))
    env.reset()
    qpos, qvel = env.sim.data.qpos[:], env.sim.data.qvel[:]
    frames = torch.from_numpy(bundle.expert.frames)[at]
    velocity = frames[:, 40:46]  # after x 3, R 4, q 21, p_ee 12
    assert velocity.abs().max() > 0.1
    linear = quat_apply_inverse(qpos[:, 3:7], qvel[:, :3])
    torch.testing.assert_close(torch.cat([linear, qvel[:, 3:6]], dim=1), velocity, atol=1e-4, rtol=0.0)


def test_noise_is_of_each_sensor_and_on_both_sides(bundle: Bundle):
    """Half widths of gyro, gravity, command, joint positions, joint speeds and last action."""
    env = made(bundle, simulation__num_envs=MANY, randomization__noise=1.0)
    steps = []
    for _ in range(20):
        seen = env.step(torch.zeros(MANY, 21))[0]
        steps.append(seen["actor"][:, -72:] - seen["critic"][:, :72])
    parts = torch.split(torch.cat(steps), [3, 3, 3, 21, 21, 21], dim=1)
    for part, half in zip(parts, (0.2, 0.05, 0.0, 0.01, 0.5, 0.0), strict=True):
        assert part.abs().max().item() == pytest.approx(half, rel=0.05, abs=1e-5)
        assert part.mean().item() == pytest.approx(0.0, abs=0.05 * half + 1e-6)


def test_training_and_validation_have_the_same_torque_speed_line():
    generator = torch.Generator().manual_seed(0)
    target, pos, vel = (5.0 * torch.randn(500, 1, generator=generator, dtype=torch.float64) for _ in range(3))
    vel = 4.0 * vel
    sizes = {
        "force_limit": 60.0,
        "saturation_effort": 300.0,
        "stiffness": 50.0,
        "damping": 1.0,
        "velocity_limit_motor": 15.7125,
    }
    params = {name: torch.tensor([value], dtype=torch.float64) for name, value in sizes.items()}
    asked = ActuatorCmd(position_target=target, velocity_target=vel, effort_target=vel, pos=pos, vel=vel)
    envelope = TorqueEnvelope(limit=np.array([60.0]), knee_speed=np.array([12.57]), no_load_speed=np.array([15.7125]))
    wanted = envelope.clip((50.0 * (target - pos) - vel).numpy(), vel.numpy())
    np.testing.assert_allclose(LineMotor.control_law(params, asked).numpy(), wanted, atol=1e-4)
