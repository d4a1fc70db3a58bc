"""The task reward's terms on states whose answer is known on paper."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training import reward_terms as terms
from pipeline.training.options import Options
from pipeline.training.presets import PRESETS
from pipeline.training.reward_table import table

WEIGHTS = {
    "tracking_x": 3.0,
    "tracking_y": 3.0,
    "tracking_yaw": 3.0,
    "lin_vel_z": -1.0,
    "ang_vel_xy": -0.05,
    "energy": -1e-3,
    "torque": -1e-4,
    "joint_vel": -1e-3,
    "joint_acc": -2.5e-7,
    "action_rate": -0.1,
    "orientation": -2.0,
    "joint_limit": -20.0,
    "termination": -200.0,
    "undesired_contacts": -1.0,
    "feet_slide": -0.25,
    "feet_force": -3e-3,
    "feet_too_near": -2.0,
    "feet_stumble": -2.0,
    "feet_lateral_distance": -2.0,
}
"""Table "Summary of Task Reward Function" of the paper."""


def test_the_papers_preset_has_its_nineteen_terms_with_their_weights():
    rows = table(PRESETS["paper"][1])
    assert {row.name: row.weight for row in rows} == pytest.approx(WEIGHTS)
    assert not any(row.added for row in rows)


def test_what_other_presets_add_says_why():
    for name, (_, options) in PRESETS.items():
        unknown = [row.name for row in table(options) if row.name not in WEIGHTS and not row.added]
        assert not unknown, f"{name}: {unknown}"


def test_tracking_is_one_at_the_command_and_falls_as_a_gauss_bell():
    command = torch.tensor([[1.0, 0.0, -0.5]])
    value = terms.tracking(command, torch.tensor([[0.5, 0.0, -0.5]]), 0.25)
    assert value[0].tolist() == pytest.approx([math.exp(-1.0), 1.0, 1.0])
    both = terms.joint_tracking(command, torch.tensor([[0.5, 0.5, -0.5]]), 0.5)
    assert both.item() == pytest.approx(math.exp(-1.0))


def test_squares_are_summed_over_joints():
    assert terms.square(torch.tensor([-3.0, 2.0])).tolist() == [9.0, 4.0]
    assert terms.square(torch.tensor([[3.0, 4.0], [1.0, 0.0]])).tolist() == [25.0, 1.0]


def test_energy_is_the_norm_of_the_joints_powers():
    torque, speed = torch.tensor([[2.0, -5.0]]), torch.tensor([[1.5, 0.8]])
    assert terms.energy(torque, speed).item() == pytest.approx(5.0)


def test_power_is_summed_over_joints_whatever_its_sign():
    torque, speed = torch.tensor([[3.0, 4.0]]), torch.tensor([[1.0, -1.0]])
    assert terms.power(torque, speed).item() == 7.0


@pytest.mark.parametrize(
    ("option", "row"),
    [
        ("ang_vel_factor", "ang_vel_xy"),
        ("feet_apart_factor", "feet_lateral_distance"),
        ("fall_factor", "termination"),
    ],
)
def test_factors_are_of_the_papers_weights(option: str, row: str):
    weights = []
    for factor in (1.0, 5.0):
        rows = table(PRESETS["paper_flat"][1].changed(**{option: factor}))
        weights.append({each.name: each.weight for each in rows})
    assert {name for name in weights[0] if weights[0][name] != weights[1][name]} == {row}
    assert weights[1][row] == 5.0 * weights[0][row] < 0.0


@pytest.mark.parametrize("sigma2", [0.0, 0.25])
def test_steps_are_paid_as_far_as_the_command_is_followed_where_that_is_asked(sigma2: float):
    options = PRESETS["paper_flat"][1].changed(long_step=2.0, long_step_sigma2=sigma2)
    (row,) = (row for row in table(options) if row.name == "long_step")
    mean = torch.tensor([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    env = SimpleNamespace(
        command=torch.tensor([[1.0, 0.0, 0.0]] * 2),
        readings=SimpleNamespace(step_s=torch.tensor([0.4, 0.4]), mean_velocity=mean),
        step_times=lambda command: torch.full((2,), 0.4),
        step_dt=0.02,
    )
    assert row.value(env).tolist() == pytest.approx([20.0, 20.0 * (math.exp(-1.0) if sigma2 else 1.0)])


def test_joints_beyond_their_limits_count_one_each():
    lower, upper = torch.tensor([-1.0, -1.0, -1.0]), torch.tensor([1.0, 1.0, 1.0])
    joints = torch.tensor([[1.01, -1.01, 0.0], [0.99, -0.99, 0.0]])
    assert terms.limit_indicator(joints, lower, upper).tolist() == [2.0, 0.0]
    excess = terms.limit_excess(joints, lower, upper)
    assert excess.tolist() == pytest.approx([0.08, 0.04], abs=1e-6)


def test_shapes_pressed_by_more_than_a_newton_are_counted():
    force = torch.tensor([[[0.0, 0.0, 0.9], [0.8, 0.0, 0.8], [3.0, 4.0, 0.0]]])
    assert terms.undesired_contacts(force, 1.0).item() == 2.0


def test_only_a_foot_that_touches_slides():
    speed = torch.tensor([[[0.3, 0.4, 9.0], [1.0, 0.0, 0.0]]])
    assert terms.feet_slide(torch.tensor([[True, False]]), speed).item() == pytest.approx(0.5)
    assert terms.feet_slide(torch.tensor([[True, True]]), speed).item() == pytest.approx(1.5)


@pytest.mark.parametrize(("force", "cost"), [(400.0, 0.0), (600.0, 100.0), (2000.0, 400.0)])
def test_foot_force_costs_between_500_and_900_newtons(force, cost):
    feet = torch.zeros(1, 2, 3)
    feet[0, 0, 2] = -force
    assert terms.feet_force(feet).item() == pytest.approx(cost)


def test_feet_nearer_than_twenty_centimetres_cost_what_is_missing():
    feet = torch.tensor([[[0.0, 0.0, 0.0], [0.0, 0.15, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.3, 0.0]]])
    assert terms.feet_too_near(feet).tolist() == pytest.approx([0.05, 0.0])


def test_a_foot_pushed_sideways_more_than_five_times_as_up_stumbles():
    force = torch.tensor([[[6.0, 0.0, 1.0], [0.0, 0.0, 300.0]], [[4.0, 0.0, 1.0], [0.0, 0.0, 300.0]]])
    assert terms.feet_stumble(force).tolist() == [1.0, 0.0]


def test_lateral_distance_of_the_feet_costs_unless_told_to_go_sideways():
    command = torch.tensor([[1.0, 0.05, 0.0], [0.0, 0.3, 0.0]])
    assert terms.feet_lateral_distance(command, torch.tensor([-0.26, -0.26])).tolist() == pytest.approx([0.06, 0.0])


def test_standing_still_costs_only_while_told_to_stand():
    command = torch.tensor([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    contacts = torch.tensor([[True, False], [True, False]])
    speed = torch.tensor([[3.0, 4.0], [3.0, 4.0]])
    assert terms.standing_still(command, contacts, speed).tolist() == pytest.approx([1.25, 0.0])


def test_standing_the_right_foot_may_count_more():
    command, speed = torch.zeros(4, 3), torch.zeros(4, 2)
    contacts = torch.tensor([[True, True], [False, True], [True, False], [False, False]])
    assert terms.standing_still(command, contacts, speed, 0.5).tolist() == pytest.approx([0.0, 1.0, 1.5, 2.5])


def test_time_on_one_foot_is_paid_up_to_its_bound_and_only_on_one():
    command = torch.tensor([[1.0, 0.0, 0.0]] * 3)
    contacts = torch.tensor([[True, False], [True, False], [True, True]])
    times = torch.tensor([[0.3, 0.2], [0.9, 0.8], [0.3, 0.3]])
    assert terms.single_stance(command, contacts, times).tolist() == pytest.approx([0.2, 0.4, 0.0])


def test_torque_near_its_limit_costs_the_share_beyond():
    limit = torch.tensor([10.0, 100.0])
    assert terms.saturation(torch.tensor([[9.5, -80.0]]), limit).item() == pytest.approx(0.1)


def test_an_option_of_zero_takes_its_term_out():
    names = {row.name for row in table(Options(mean_tracking=1.0))}
    assert "mean_tracking" in names
    assert "mean_tracking" not in {row.name for row in table(Options())}


def test_progress_is_the_share_of_what_is_asked_for_that_is_reached():
    command = torch.tensor([[2.0, 0, 0], [0.3, 0, 0], [0, 0, -1.0], [1.0, 0, 1.0], [0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]])
    velocity = torch.tensor(
        [[0.5, 0, 0], [0.3, 0.2, 0], [0, 0, -0.5], [1.0, 0, 0], [1.0, 0, 1.0], [-2.0, 0, 0], [3.0, 0, 0]]
    )
    assert terms.progress(command, velocity).tolist() == pytest.approx([0.25, 1.0, 0.5, 0.5, 0.0, -1.0, 1.0])


def test_who_stays_on_one_foot_is_not_paid_for_it():
    command, contacts = torch.tensor([[1.0, 0.0, 0.0]] * 2), torch.tensor([[True, False]] * 2)
    times = torch.tensor([[0.5, 0.55], [0.7, 0.8]])
    assert terms.single_stance(command, contacts, times, 0.6).tolist() == pytest.approx([0.4, 0.0])


def test_a_motor_gives_less_the_faster_it_turns_its_own_way():
    limit, stall, no_load = (torch.tensor([value, value]) for value in (60.0, 120.0, 20.0))
    torque = torch.tensor([[10.0, -10.0], [10.0, 10.0], [10.0, 10.0]])
    speed = torch.tensor([[15.0, 15.0], [5.0, 30.0], [0.0, -30.0]])
    expected = [[30.0, 60.0], [60.0, 6.0], [60.0, 60.0]]
    assert terms.motor_limit(torque, speed, limit, stall, no_load).tolist() == expected
    endless = torch.tensor([torch.inf, torch.inf])
    assert terms.motor_limit(torque, speed, limit, endless, endless).tolist() == [[60.0, 60.0]] * 3


def test_a_stall_costs_its_share_of_a_fall_whatever_that_costs():
    weights = {row.name: row.weight for row in table(PRESETS["gated_style"][1].changed(fall_factor=4.0))}
    assert (weights["termination"], weights["stalled"]) == (-800.0, -400.0)


def test_ends_of_episodes_are_not_softened_at_the_start():
    ramps = {row.name: row.grows for row in table(PRESETS["gated_style"][1])}
    assert (ramps["termination"], ramps["stalled"], ramps["feet_slide"]) == ("", "", "penalty")


def test_steps_are_paid_for_their_time_the_more_the_longer_up_to_the_clips():
    command = torch.tensor([[1.0, 0.0, 0.0]] * 5 + [[0.0, 0.0, 0.0]])
    time = torch.tensor([0.15, 0.3, 0.6, 5.0, 0.0, 0.3])
    paid = terms.long_step(command, time, torch.full((6,), 0.4), 0.0, 0.75)
    assert paid.tolist() == pytest.approx([0.15 * 0.5, 0.3, 0.6, 0.6, 0.0, 0.0])
    halves, whole = paid[0] / 0.15, paid[1] / 0.3
    assert halves.item() == pytest.approx(0.5 * whole.item()), (
        "a second of short steps is paid half of one of long ones"
    )
    assert terms.long_step(command, time, torch.zeros(6), 0.0, 0.75).tolist() == pytest.approx([0.0] * 6), (
        "no clip steps"
    )
    times, clips = torch.tensor([0.15, 0.2, 0.25, 0.3, 0.6, 0.3]), torch.full((6,), 0.4)
    above_half = terms.long_step(command, times, clips, 0.5, 0.75)
    assert above_half.tolist() == pytest.approx([0.0, 0.0, 0.25 / 2.0, 0.3, 0.6, 0.0]), "shorter ones are paid nothing"
    whole = terms.long_step(command, times, clips, 0.5, 1.0)
    assert whole.tolist() == pytest.approx([0.0, 0.0, 0.25 / 4.0, 0.15, 0.6, 0.0]), (
        "in full only where they take as long"
    )


@pytest.mark.parametrize(("least", "full"), [(-0.1, 0.75), (0.75, 0.75), (0.5, 1.6)])
def test_shares_of_a_step_that_make_no_slope_are_refused(least: float, full: float):
    with pytest.raises(TrainingError, match="'long_step_share' and 'long_step_full'"):
        table(PRESETS["paper"][1].changed(long_step_share=least, long_step_full=full))
