"""How long the clips' steps take, and how long those of simulated robots are found to be."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.training.bundle import FPS
from pipeline.training.plain_walk import AIR_S
from pipeline.training.readings import Readings
from pipeline.training.step_times import StepTimes, _landings, steps
from tests.factories.expert_frames import expert_of, walking


def test_steps_of_clips_are_from_one_foots_landing_to_the_others():
    end, seconds = steps(expert_of(walking(0.4, 4.0, 1.0), walking(0.6, 6.0, 0.6)))
    first = end < 4.0 * FPS
    assert seconds[first] == pytest.approx(0.4)
    assert seconds[~first] == pytest.approx(0.6)
    assert first.sum() >= 7 and (~first).sum() >= 7


def test_a_command_is_answered_by_the_steps_of_the_nearest_clips():
    stands = walking(100.0, 5.0, 0.0)
    times = StepTimes(expert_of(walking(0.4, 4.0, 1.5), walking(0.6, 6.0, 0.6), stands), "cpu")
    asked = torch.tensor([[2.0, 0.0, 0.0], [0.5, 0.1, 0.0], [-0.3, 0.0, 0.0]])
    assert times(asked).tolist() == pytest.approx([0.4, 0.6, 0.6])


def test_where_no_clip_steps_no_time_is_wanted():
    assert StepTimes(expert_of(walking(100.0, 5.0, 0.0)), "cpu")(torch.ones(2, 3)).tolist() == [0.0, 0.0]


class Ground:
    """What the times of steps are worked out of: two feet of one robot, told to touch or not."""

    step_dt, num_envs, device = 0.02, 1, "cpu"


def step_times_of(touching: list[tuple[bool, bool]], stands_until: int = 0) -> list[float]:
    """What `step_s` is at each control step."""
    read = Readings.__new__(Readings)
    read._env, read._known = Ground(), {}
    read._stance, read._stood = torch.zeros(1, 2), torch.ones(1, 2, dtype=torch.bool)
    read._landed = torch.zeros(1, 2, dtype=torch.bool)
    read._set_down, read._since, read._step = torch.full((1,), -1), torch.zeros(1), torch.zeros(1)
    read._both, read._double = torch.zeros(1), torch.zeros(1)
    found = []
    for at, feet in enumerate(touching):
        read._advance_stances(torch.tensor([feet]), torch.tensor([at >= stands_until]))
        found.append(round(float(read.step_s[0]), 3))
    return found


BOTH, LEFT, RIGHT, NONE = (True, True), (True, False), (False, True), (False, False)


def test_a_step_is_the_time_since_the_other_foot_was_set_down():
    found = step_times_of([BOTH, *[RIGHT] * 10, BOTH, *[LEFT] * 10, BOTH, *[RIGHT] * 5, BOTH])
    assert [time for time in found if time] == [0.22, 0.12]


def test_bounces_hops_and_jumps_are_no_steps():
    bounces = [BOTH, *[RIGHT] * 10, BOTH, RIGHT, BOTH, RIGHT, RIGHT, BOTH]
    hops = [BOTH, *([LEFT] * 5 + [NONE] * 5) * 4]
    jumps = [BOTH, *([NONE] * 8 + [BOTH] * 4) * 4]
    assert not any(step_times_of(bounces) + step_times_of(hops) + step_times_of(jumps))


def test_a_foot_set_down_twice_makes_no_longer_step():
    left, right = [RIGHT] * 5 + [BOTH] * 5, [LEFT] * 5 + [BOTH] * 5
    found = step_times_of([BOTH, *(left + left + right + right) * 3])
    assert [time for time in found if time] == [0.2] * 5


def test_the_shortest_swing_is_the_one_of_the_clips():
    swing = round(AIR_S * FPS)
    for frames, count in ((swing, 1), (swing - 1, 0)):
        found = step_times_of([BOTH, *[RIGHT] * 10, BOTH, BOTH, *[LEFT] * frames, BOTH])
        assert len([time for time in found if time]) == count
        lifted = np.array([False, False, *[True] * frames, False])
        assert len(_landings(lifted)) == count


def test_time_stood_before_a_command_is_no_step():
    steps = [BOTH, *[RIGHT] * 10, *[BOTH] * 100, *[LEFT] * 10, BOTH, *[RIGHT] * 10, BOTH]
    assert [time for time in step_times_of(steps, stands_until=105) if time] == [0.22]
