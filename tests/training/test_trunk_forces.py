"""The helping hand: its wrench in closed form, who it holds, and that it lets go."""

from __future__ import annotations

import math

import pytest
import torch
from mjlab.utils.lab_api.math import matrix_from_quat, quat_from_euler_xyz

from pipeline.training.bundle import read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.options import Options
from pipeline.training.presets import preset
from pipeline.training.ramps import Ramps
from pipeline.training.readings import velocity_of
from pipeline.training.trunk_forces import FORCE_DAMPING, MOMENT, MOMENT_DAMPING, helping_wrench
from tests.factories.training_bundle import small_bundle

ENVS = 6
STANDING = {"standing_share": 1.0, "fast_share": 0.0, "slow_share": 0.0, "alone_shares": (0.0, 0.0, 0.0)}
HELPED = {"push_impulse": (0.0, 0.0), "reference_share": 0.0, **STANDING}


def wrench(roll: float, pitch: float, yaw: float, lin_vel_w, ang_vel_b, command):
    """Of one trunk at roll, pitch and yaw [rad]; velocities [m/s, rad/s]."""
    angles = (torch.tensor([angle]) for angle in (roll, pitch, yaw))
    rotation = matrix_from_quat(quat_from_euler_xyz(*angles))
    lin_vel_w, ang_vel_b, command = (
        torch.tensor([each], dtype=torch.float32) for each in (lin_vel_w, ang_vel_b, command)
    )
    velocity, heading = velocity_of(rotation, lin_vel_w, ang_vel_b)
    force, moment = helping_wrench(rotation[:, 2], rotation, ang_vel_b, heading, velocity, command)
    return force[0].tolist(), moment[0].tolist()


STILL = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("state", "force", "moment"),
    [
        ((0.0, 0.0, 1.0, *STILL), [0, 0, 0], [0, 0, 0]),
        ((0.1, 0.0, 0.0, *STILL), [0, 0, 0], [-MOMENT * math.sin(0.1), 0, 0]),
        ((0.0, 0.1, 0.0, *STILL), [0, 0, 0], [0, -MOMENT * math.sin(0.1), 0]),
        ((0.0, 0.1, math.pi / 2, *STILL), [0, 0, 0], [MOMENT * math.sin(0.1), 0, 0]),
        ((0, 0, math.pi / 2, [0, 0, 0], [0, 0, 0], [1.5, 0, 0]), [0, 1.5 * FORCE_DAMPING, 0], [0, 0, 0]),
        ((0, 0, math.pi / 2, [0, 1.5, 0.3], [0, 0, 0], [1.5, 0, 0]), [0, 0, 0], [0, 0, 0]),
        ((0, 0, 0, [0, 0, 0], [0.2, 0, 0], [0, 0, 0.5]), [0, 0, 0], [-0.2 * MOMENT_DAMPING, 0, 0.5 * MOMENT_DAMPING]),
    ],
)
def test_the_hand_pulls_upright_and_to_the_command(state, force, moment):
    told_force, told_moment = wrench(*state)
    assert told_force == pytest.approx(force, abs=1e-4)
    assert told_moment == pytest.approx(moment, abs=1e-4)


def shaken(bundle_folder, assist: float, schedule: float, steps: int = 250) -> int:
    """Falls of robots that are to stand and shake all joints by chance."""
    options = preset("long_steps").changed(**HELPED, assist=assist)
    env = AmpEnvironment(read_bundle(bundle_folder), options, ENVS, "cpu", seed=3)
    env.schedule = schedule
    env.reset()
    given, falls = torch.Generator().manual_seed(2), 0
    for _ in range(steps):
        env.step(0.6 * torch.randn(ENVS, 21, generator=given))
        falls += int(env.fell.sum())
    return falls


def test_who_is_held_does_not_fall_and_who_is_let_go_does(tmp_path, root, robot):
    folder = small_bundle(tmp_path, root, robot)
    last = preset("long_steps").assist_iterations[1]
    assert shaken(folder, 1.0, 0.0) == 0
    assert shaken(folder, 1.0, last) >= ENVS
    assert shaken(folder, 0.0, 0.0) >= ENVS


def test_a_robot_that_is_held_is_pushed_too(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    acting = {}
    for assist in (0.0, 0.5):
        env = AmpEnvironment(bundle, preset("long_steps").changed(**HELPED, assist=assist), ENVS, "cpu", seed=3)
        env.reset()
        for push in (0.0, 40.0):
            env.trunk_forces.push_w[:, 1] = push
            env.trunk_forces.write()
            acting[assist, push] = env.sim.data.xfrc_applied[:].sum(dim=1)
        env._reset_idx(torch.tensor([1, 4]))
        assert env.trunk_forces.push_w[:, 1].tolist() == pytest.approx([40.0, 0.0, 40.0, 40.0, 0.0, 40.0])
    pushed = torch.zeros(ENVS, 6)
    pushed[..., 1] = 40.0
    assert torch.equal(acting[0.0, 0.0], torch.zeros(ENVS, 6))
    assert torch.equal(acting[0.0, 40.0], pushed)
    assert acting[0.5, 0.0].abs().max() > 1.0
    assert torch.allclose(acting[0.5, 40.0] - acting[0.5, 0.0], pushed, atol=1e-3)


def test_the_hand_lets_go_between_its_iterations():
    ramps = Ramps(Options(assist=0.8, assist_iterations=(100, 300)), "cpu")
    told = []
    for iteration in (0.0, 100.0, 200.0, 300.0, 900.0):
        ramps.at(iteration)
        told.append(float(ramps.assist))
    assert told == pytest.approx([0.8, 0.8, 0.4, 0.0, 0.0])
