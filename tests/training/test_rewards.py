"""Reward terms on states whose value is known, and the paper's table."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
import torch

from pipeline.learning.robot_facts import T1_LEG_M, T1_WEIGHT_N, RobotFacts
from pipeline.training.config import PAPER, RECIPE
from pipeline.training.mdp import rewards

WEIGHTS = {
    "track_lin_vel_x": 3.0,
    "track_lin_vel_y": 3.0,
    "track_ang_vel_z": 3.0,
    "lin_vel_z": -1.0,
    "ang_vel_xy": -0.05,
    "energy": -1e-3,
    "torque": -1e-4,
    "joint_vel": -1e-3,
    "joint_acc": -2.5e-7,
    "action_rate": -0.1,
    "orientation": -2.0,
    "joint_limit": -20.0,
    "fallen": -200.0,
    "undesired_contacts": -1.0,
    "feet_slide": -0.25,
    "feet_force": -3e-3,
    "feet_too_near": -2.0,
    "feet_stumble": -2.0,
    "feet_lateral_distance": -2.0,
}
"""Table "Summary of Task Reward Function" of the paper."""


def robot_of(weight: float, leg_length: float) -> Any:
    """A robot of a weight [N] and a leg length [m], and nothing else."""
    ratios = {"weight_ratio": weight / T1_WEIGHT_N, "leg_ratio": leg_length / T1_LEG_M}
    return Mock(spec=RobotFacts, weight=weight, leg_length=leg_length, **ratios)


T1 = robot_of(T1_WEIGHT_N, T1_LEG_M)


def env(command=(0.0, 0.0, 0.0), **state: Any) -> Any:
    """An environment of one robot with some quantities."""
    return SimpleNamespace(
        command=torch.tensor([command]),
        robot_state=SimpleNamespace(**{name: torch.as_tensor(value)[None] for name, value in state.items()}),
    )


def test_the_paper_has_its_nineteen_terms_with_their_weights():
    terms = rewards.reward_cfg(T1, PAPER)
    assert {name: term.weight for name, term in terms.items() if name != "stalled"} == pytest.approx(WEIGHTS)


def test_the_recipe_adds_only_what_its_options_name():
    added = set(rewards.reward_cfg(T1, RECIPE)) - set(WEIGHTS)
    assert added == {"track_all", "track_mean", "progress", "stand_still", "power", "saturation", "stalled"}


def test_tracking_is_one_at_the_command_and_falls_as_a_bell():
    one = env((1.0, 0.0, -0.5), velocity=(0.5, 0.0, -0.5), mean_velocity=(0.5, 0.5, -0.5))
    values = [rewards.track_axis(one, axis).item() for axis in range(3)]
    assert values == pytest.approx([math.exp(-1.0), 1.0, 1.0])
    assert rewards.track_all(one, 0.25).item() == pytest.approx(math.exp(-2.0))


def test_progress_is_the_mean_share_of_the_commanded_halves():
    command = torch.tensor([[2.0, 0, 0], [0.3, 0, 0], [0, 0, -1.0], [1.0, 0, 1.0], [0, 0, 0], [0.5, 0, 0]])
    velocity = torch.tensor([[0.5, 0, 0], [0.3, 0.2, 0], [0, 0, -0.5], [1.0, 0, 0], [1.0, 0, 1.0], [-2.0, 0, 0]])
    assert rewards.reached_share(command, velocity).tolist() == pytest.approx([0.3125, 1.0, 0.625, 0.5, 0.0, -1.0])


def test_progress_does_not_reward_overshoot_of_a_swaying_gait():
    """A velocity that sways by 15 % about the command, and one about 1.1 of it."""
    sway = 1.0 + 0.15 * torch.sin(torch.linspace(0.0, 2.0 * math.pi, 101)[:-1])
    command = torch.tensor([[1.0, 0.0, 0.0]]).expand(100, 3)
    means = [rewards.reached_share(command, factor * sway[:, None] * command).mean().item() for factor in (1.0, 1.1)]
    assert means == pytest.approx([1.0, 1.0])
    weak = rewards.reached_share(command, 0.6 * sway[:, None] * command).mean().item()
    assert weak == pytest.approx(0.75, abs=0.01)


def test_standing_still_costs_only_at_the_command_to_stand():
    state = {"contacts": (True, False), "joint_vel": (3.0, 4.0)}
    still = {"lin_vel_b": (0.0, 0.1, 0.0), **state}
    assert rewards.stand_still(env((0.0, 0.0, 0.0), **still), 0.2).item() == pytest.approx(1.25)
    assert rewards.stand_still(env((0.3, 0.0, 0.0), **still), 0.2).item() == 0.0
    pushed = env((0.0, 0.0, 0.0), lin_vel_b=(0.0, 0.4, 0.0), **state)
    assert rewards.stand_still(pushed, 0.2).item() == pytest.approx(0.25), "a step that catches a push is free"


def test_power_is_the_sum_and_energy_the_norm():
    state = env(torque=(3.0, -4.0), joint_vel=(1.0, 1.0))
    for final, factor in ((0.0, 1.0), (0.5, 1.5), (1.0, 2.0)):
        state.final = torch.tensor(final)
        assert rewards.power(state, last=2.0).item() == pytest.approx(7.0 * factor)
    assert rewards.energy(state).item() == pytest.approx(5.0)


def test_a_motor_gives_less_the_faster_it_turns_its_own_way():
    limit, stall, no_load = (torch.tensor([value, value]) for value in (60.0, 120.0, 20.0))
    torque = torch.tensor([[10.0, -10.0], [10.0, 10.0], [10.0, 10.0]])
    speed = torch.tensor([[15.0, 15.0], [5.0, 30.0], [0.0, -30.0]])
    assert rewards.motor_limit(torque, speed, limit, stall, no_load).tolist() == [
        [30.0, 60.0],
        [60.0, 6.0],
        [60.0, 60.0],
    ]
    endless = torch.tensor([torch.inf, torch.inf])
    assert rewards.motor_limit(torque, speed, limit, endless, endless).tolist() == [[60.0, 60.0]] * 3


def test_saturation_is_the_share_beyond_the_free_torque():
    given = env(torque=(9.5, -80.0), joint_vel=(0.0, 0.0))
    given.effort_limit = torch.tensor([10.0, 100.0])
    given.stall_torque = given.no_load_speed = torch.tensor([torch.inf, torch.inf])
    assert rewards.saturation(given).item() == pytest.approx(0.1)


def test_joints_beyond_their_limits_are_counted():
    given = env(joint_pos=(1.1, -0.5, -1.2))
    given.joint_limits = (torch.full((3,), -1.0), torch.full((3,), 1.0))
    assert rewards.joints_beyond_limits(given).item() == 2.0


def test_only_feet_in_contact_slide():
    velocity = ((0.3, 0.4, 9.0), (1.0, 0.0, 0.0))
    assert rewards.feet_slide(env(lowest_corner_vel_w=velocity, contacts=(True, False))).item() == pytest.approx(0.5)
    assert rewards.feet_slide(env(lowest_corner_vel_w=velocity, contacts=(True, True))).item() == pytest.approx(1.5)


@pytest.mark.parametrize(("force", "cost"), [(400.0, 0.0), (600.0, 100.0), (2000.0, 400.0)])
def test_foot_force_costs_between_500_and_900_newtons(force, cost):
    given = env(feet_force_w=((0.0, 0.0, -force), (0.0, 0.0, 0.0)))
    params = rewards.reward_cfg(T1, PAPER)["feet_force"].params
    assert rewards.feet_force(given, **params).item() == pytest.approx(cost, abs=0.05)


def test_distances_and_stumbles_of_the_feet():
    near = env(feet_pos_w=((0.0, 0.0, 0.0), (0.0, 0.15, 0.0)))
    assert rewards.feet_too_near(near, 0.2).item() == pytest.approx(0.05)
    apart = {"feet_pos_w": ((0.0, 0.0, 0.0), (0.26, 0.0, 0.0)), "heading_w": (0.0, 1.0)}
    assert rewards.feet_lateral_distance(env((1.0, 0.0, 0.0), **apart), 0.2).item() == pytest.approx(0.06)
    assert rewards.feet_lateral_distance(env((0.0, 0.3, 0.0), **apart), 0.2).item() == 0.0
    for sideways, stumbles in ((6.0, 1.0), (4.0, 0.0)):
        given = env(feet_force_w=((sideways, 0.0, 1.0), (0.0, 0.0, 300.0)))
        assert rewards.feet_stumble(given).item() == stumbles


def test_foot_forces_and_distances_scale_from_the_papers_t1_values():
    smaller = robot_of(0.5 * T1.weight, 0.8 * T1.leg_length)
    for robot, force, distance in ((T1, 500.0, 0.2), (smaller, 250.0, 0.16)):
        terms = rewards.reward_cfg(robot, PAPER)
        assert terms["feet_force"].params["soft"] == pytest.approx(force, rel=1e-3)
        assert terms["feet_force"].params["span"] == pytest.approx(0.8 * force, rel=1e-3)
        for name in ("feet_too_near", "feet_lateral_distance"):
            assert terms[name].params["distance"] == pytest.approx(distance)


def test_shapes_that_touch_are_counted():
    given = env(other_force_w=((0.0, 0.0, 0.5), (0.0, 2.0, 0.0), (9.0, 0.0, 0.0)))
    assert rewards.undesired_contacts(given).item() == 2.0


@pytest.mark.parametrize(("name", "off"), [("track_all", 0.5), ("track_mean", math.sqrt(0.05))])
def test_the_recipes_kernels_fall_to_1_by_e_at_their_own_widths(name, off):
    term = rewards.reward_cfg(T1, RECIPE)[name]
    state = env((1.0, 0.0, 0.0), velocity=(1.0 - off, 0.0, 0.0), mean_velocity=(1.0 - off, 0.0, 0.0))
    assert term.func(state, **term.params).item() == pytest.approx(math.exp(-1.0))


def test_only_following_is_rewarded_and_a_stall_costs_half_a_fall():
    terms = rewards.reward_cfg(T1, RECIPE)
    paid = {name for name, term in terms.items() if term.weight > 0.0}
    assert paid == {"track_all", "track_mean", "progress"}
    assert 2.0 * terms["stalled"].weight == terms["fallen"].weight
