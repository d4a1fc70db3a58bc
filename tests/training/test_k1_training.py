"""The training environment on the K1: its own fall height, pushes and foot distance, by the recipe of the T1."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from pipeline.learning.robot_facts import RobotFacts
from pipeline.robot import Robot, load_robot
from pipeline.simulation.run import fall_height
from pipeline.training.bundle import read_bundle
from pipeline.training.config import RECIPE
from pipeline.training.environment import AmpEnvironment
from pipeline.training.mdp.events import Kick, Push
from tests.factories.training_bundle import small_bundle


def facts_of(tmp_path: Path, root: Path, robot: Robot) -> RobotFacts:
    return read_bundle(small_bundle(tmp_path / robot.name, root, robot)).robot


def test_ratios_of_a_bundle_are_one_for_the_t1_and_the_k1s_own(tmp_path: Path, root: Path, robot: Robot):
    k1 = load_robot("k1")
    ours, other = (facts_of(tmp_path, root, each) for each in (robot, k1))
    assert (ours.weight_ratio, ours.leg_ratio, ours.fall_height) == (1.0, 1.0, 0.45)
    assert other.weight_ratio == pytest.approx(k1.total_mass / robot.total_mass, rel=1e-4)
    assert other.leg_ratio == pytest.approx(k1.leg_length / robot.leg_length, rel=1e-6)
    assert other.fall_height == fall_height(k1)
    heights = k1.default_root_height / robot.default_root_height
    assert other.fall_height / ours.fall_height == pytest.approx(heights, rel=1e-4)


def test_an_environment_of_the_k1_falls_and_is_pushed_in_its_own_size(tmp_path: Path, root: Path):
    robot = load_robot("k1")
    config = RECIPE.changed({"simulation.num_envs": 3, "simulation.reference_share": 0.0})
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    env = AmpEnvironment(bundle, config, "cpu", seed=1)
    env.reset()
    facts, pushes = bundle.robot, config.pushes
    speed = facts.leg_ratio**0.5
    largest = {type(each.func): each.func._timer._max_push[1] for each in env.event_manager._mode_term_cfgs["step"]}
    assert largest[Kick] == pytest.approx(speed * pushes.kick_m_s[1])
    assert largest[Push] == pytest.approx(facts.weight_ratio * speed * pushes.impulse_n_s[1])
    low, high = fall_height(robot) - 0.02, fall_height(robot) + 0.05
    env.sim.data.qpos[0, 2], env.sim.data.qpos[1, 2] = low, high
    env.sim.forward()
    env.termination_manager.compute()
    assert env.termination_manager.get_term("height").tolist() == [True, False, False]
    assert torch.isfinite(env.observation_manager.compute()["actor"]).all()
