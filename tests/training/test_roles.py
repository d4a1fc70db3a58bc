"""Whose a robot's state is: by its command, its speed, the latest push, how it leans and how the ground slopes."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.roles import ROLES, Borders, Unsteadiness, is_of, role_of

LONG_AGO = math.inf
STANDS = torch.zeros(4, 3)


@pytest.mark.parametrize(
    ("command", "since_s", "role"),
    [
        ((0.0, 0.0, 0.0), LONG_AGO, "standing"),
        ((0.0, 0.0, -0.01), LONG_AGO, "other"),
        ((0.01, 0.0, 0.0), LONG_AGO, "other"),
        ((0.55, 0.0, 0.0), LONG_AGO, "ahead"),
        ((0.5499, 0.0, 0.0), LONG_AGO, "other"),
        ((0.8499, 0.0, 0.0), LONG_AGO, "ahead"),
        ((0.85, 0.0, 0.0), LONG_AGO, "fast"),
        ((2.0, 0.0, 0.0), LONG_AGO, "fast"),
        ((2.0, 0.0, 1.01), LONG_AGO, "other"),
        ((-1.0, 0.0, 0.0), LONG_AGO, "other"),
        ((1.0, 0.3, 0.0), LONG_AGO, "fast"),
        ((1.0, -0.3, 0.0), LONG_AGO, "fast"),
        ((1.0, 0.301, 0.0), LONG_AGO, "other"),
        ((1.0, -0.301, 0.0), LONG_AGO, "other"),
        ((1.0, 0.0, 1.0), LONG_AGO, "fast"),
        ((1.0, 0.0, -1.0), LONG_AGO, "fast"),
        ((1.0, 0.0, 1.001), LONG_AGO, "other"),
        ((1.0, 0.0, -1.001), LONG_AGO, "other"),
        ((0.55, -0.3, 1.0), LONG_AGO, "ahead"),
        ((1.0, 0.0, 0.0), 0.99, "pushed"),
        ((1.0, 0.0, 0.0), 0.0, "pushed"),
        ((0.0, 0.0, 0.0), 0.98, "pushed"),
        ((0.0, 0.5, 0.0), 0.5, "pushed"),
        ((0.0, 0.0, 0.0), 1.0, "standing"),
        ((1.0, 0.0, 0.0), 1.0, "fast"),
        ((0.0, 0.5, 0.0), 1.02, "other"),
    ],
)
def test_whose_a_state_is(command, since_s, role):
    found = role_of(torch.tensor([command, command]), torch.tensor([since_s, since_s]), Borders(), torch.zeros(2, 3))
    assert [ROLES[place] for place in found.tolist()] == [role, role]


def test_each_robot_of_a_batch_has_a_role_of_its_own():
    command = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = role_of(command, torch.tensor([LONG_AGO, LONG_AGO, LONG_AGO, 0.5]), Borders(), STANDS)
    assert [ROLES[place] for place in found.tolist()] == ["standing", "other", "fast", "pushed"]


def test_a_run_may_put_the_borders_of_pushed_and_ahead_elsewhere():
    command = torch.tensor([[1.0, 0.0, 0.3], [1.0, 0.0, -0.31], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = role_of(
        command,
        torch.tensor([LONG_AGO, LONG_AGO, 1.98, 2.0]),
        Borders(pushed_s=2.0, turn_rad_s=0.3, fast_m_s=1.1),
        STANDS,
    )
    assert [ROLES[place] for place in found.tolist()] == ["ahead", "other", "pushed", "standing"]


def test_the_walk_ahead_begins_where_it_is_said():
    command = torch.tensor([[0.5, 0.0, 0.0], [0.54, 0.0, 0.0], [0.55, 0.0, 0.0]])
    roles = [
        [ROLES[place] for place in role_of(command, torch.full((3,), LONG_AGO), borders, STANDS[:3]).tolist()]
        for borders in (Borders(), Borders(ahead_m_s=0.52))
    ]
    assert roles == [["other", "other", "ahead"], ["other", "ahead", "ahead"]]


def test_who_sets_off_is_not_ahead_before_it_is_under_way_where_a_run_says_so():
    command = torch.tensor([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.3, 0.0, 0.0]])
    velocity = torch.tensor([[0.59, 0.0, 0.0], [0.6, 0.0, 0.0], [0.6, 0.0, 0.0], [0.3, 0.0, 0.0]])
    long_ago = torch.full((4,), LONG_AGO)
    found = role_of(command, long_ago, Borders(under_way=0.6), velocity)
    assert [ROLES[place] for place in found.tolist()] == ["other", "fast", "ahead", "other"]
    back = torch.full((4, 3), -0.5)
    everyone = role_of(command, long_ago, Borders(), back)
    assert [ROLES[place] for place in everyone.tolist()] == ["fast", "fast", "ahead", "other"], "where no run says so"
    slopes = torch.ones(4, dtype=torch.bool)
    found = role_of(command, long_ago, Borders(under_way=0.6), velocity, slopes)
    assert [ROLES[place] for place in found.tolist()] == ["other", "sloped", "sloped", "other"]


def test_a_run_begins_where_it_is_said_and_nowhere_unless_it_is():
    command = torch.tensor([[1.19, 0.0, 0.0], [1.2, 0.0, 0.0], [1.75, 0.0, 0.0], [2.0, 0.0, 1.5]])
    long_ago = torch.full((4,), LONG_AGO)
    found = role_of(command, long_ago, Borders(fast_m_s=1.2, run_m_s=1.75), STANDS)
    assert [ROLES[place] for place in found.tolist()] == ["ahead", "fast", "run", "other"]
    assert is_of(found, ("ahead", "fast")).tolist() == [True, True, False, False]
    assert "run" not in [ROLES[place] for place in role_of(command, long_ago, Borders(), STANDS).tolist()]
    below = role_of(command, long_ago, Borders(fast_m_s=1.2, run_m_s=1.0), STANDS)
    assert [ROLES[place] for place in below.tolist()] == ["ahead", "run", "run", "other"], "a run is fast"


def test_who_walks_on_a_slope_has_a_role_of_its_own_where_that_is_asked_for():
    command = torch.tensor([[0.6, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0], [0.6, 0.0, 0.0]])
    since_s, slopes = torch.tensor([LONG_AGO] * 4 + [0.1]), torch.tensor([True] * 5)
    found = role_of(command, since_s, Borders(), torch.zeros(5, 3), slopes)
    assert [ROLES[place] for place in found.tolist()] == ["sloped", "sloped", "other", "standing", "pushed"]
    found = role_of(command, since_s, Borders(), torch.zeros(5, 3), ~slopes)
    assert [ROLES[place] for place in found.tolist()] == ["ahead", "fast", "other", "standing", "pushed"]


def test_who_leans_counts_as_pushed_until_it_has_not_leant_for_as_long():
    """Three robots: one leans for a step, one on a slope, one is pushed and begins another episode."""
    down = torch.tensor([[0.0, 0.0, -1.0]] * 3)
    env = SimpleNamespace(
        num_envs=3,
        device="cpu",
        step_dt=0.02,
        episode_length_buf=torch.tensor([5, 5, 5]),
        readings=SimpleNamespace(gravity_b=down.clone()),
        slopes=SimpleNamespace(level=torch.tensor([True, False, True])),
        coming_pushes=[SimpleNamespace(since_s=torch.tensor([LONG_AGO, LONG_AGO, 0.5]))],
    )
    unsteady = Unsteadiness(env, 10.0)
    assert unsteady.since().tolist() == [LONG_AGO, LONG_AGO, 0.5]
    env.readings.gravity_b[:2, 0] = 0.18
    assert unsteady.since().tolist() == [0.0, LONG_AGO, 0.5]
    env.readings.gravity_b[:2, 0] = 0.17
    assert [unsteady.since()[0].item() for _ in range(3)] == pytest.approx([0.02, 0.04, 0.06])
    env.episode_length_buf[:] = 0
    assert unsteady.since()[0] == LONG_AGO
    env.readings.gravity_b[:, 1] = 0.9
    assert Unsteadiness(env, LONG_AGO).since().tolist() == [LONG_AGO, LONG_AGO, 0.5], "where nobody asks nobody leans"


@pytest.mark.parametrize(
    "wrong",
    [
        {"unsteady_deg": -1.0},
        {"pushed_s": -0.1},
        {"turn_rad_s": float("nan")},
        {"fast_m_s": -1.0},
        {"under_way": -0.5},
    ],
)
def test_borders_below_nothing_are_refused(wrong):
    with pytest.raises(TrainingError, match="it must be 0 or more"):
        Borders(**wrong)


def test_a_share_of_the_speed_is_one_at_most():
    with pytest.raises(TrainingError, match="--under-way is 65; it is a share and must be 1 at most"):
        Borders(under_way=65.0)
