"""How far hip and knee move in a stride of the clips and of robots, and what is paid for it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training import reward_terms as terms
from pipeline.training.bundle import FPS, read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.leg_swings import ClipSwings, LegSwings, swings
from pipeline.training.presets import preset
from pipeline.training.reward_table import table
from tests.factories.expert_frames import JOINTS, expert_of, walking
from tests.factories.training_bundle import small_bundle

HIP_RAD, KNEE_RAD = 0.8, 0.6
NAMES = ("Left_Knee_Pitch", "Right_Knee_Pitch", "Left_Hip_Pitch", "Right_Hip_Pitch")
CONTROLLED = (*NAMES, *(f"joint_{number}" for number in range(JOINTS - len(NAMES))))
"""The joints of the frames and of the robots."""


def _walking(step_s: float, seconds: float, speed: float, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Frames and commands of a robot that lifts its feet by turns; hips and knees turn on and on, so that a frame more
    or less shows: by HIP_RAD and KNEE_RAD in a stride, the left leg's by a fifth more, the right leg's by a fifth less.
    """
    frames, command = walking(step_s, seconds, speed)
    rad = size * np.array([1.2 * KNEE_RAD, 0.8 * KNEE_RAD, 1.2 * HIP_RAD, 0.8 * HIP_RAD])
    frames[:, 7 : 7 + len(NAMES)] = rad * np.arange(len(frames))[:, None] / round(2 * step_s * FPS)
    return frames, command


def test_a_stride_of_a_clip_is_two_steps_from_one_landing_of_a_foot_to_the_next():
    end, moved = swings(expert_of(_walking(0.4, 4.0, 1.0), _walking(0.6, 6.0, 0.6, size=2.0)), CONTROLLED)
    slow = end >= 4.0 * FPS
    assert moved[~slow] == pytest.approx(np.tile([HIP_RAD, KNEE_RAD], ((~slow).sum(), 1)), rel=1e-3)
    assert moved[slow] == pytest.approx(np.tile([2 * HIP_RAD, 2 * KNEE_RAD], (slow.sum(), 1)), rel=1e-3)
    assert (~slow).sum() >= 6 and slow.sum() >= 6


def test_a_policy_without_knees_is_told_so_by_name():
    with pytest.raises(TrainingError, match="does not move Left_Knee_Pitch, Right_Knee_Pitch"):
        swings(expert_of(walking(0.4, 4.0, 1.0)), CONTROLLED[2:])


def test_no_stride_reaches_into_the_clip_before():
    one, other = _walking(0.4, 4.0, 1.0), _walking(0.4, 4.0, 1.0)
    other[0][:, 7 : 7 + len(NAMES)] = 5.0
    end, moved = swings(expert_of(one, other), CONTROLLED)
    assert (moved[end >= 4.0 * FPS] == 0.0).all()
    assert (moved[end < 4.0 * FPS] < 1.0).all()


def test_a_command_is_answered_by_the_median_stride_that_ends_with_the_nearest():
    frames, command = _walking(0.4, 10.0, 1.5)
    frames[:, 7 : 7 + len(NAMES)] **= 2  # every stride is longer than the one before
    command[len(command) // 2 :, 0] = 0.6
    expert = expert_of((frames, command), _walking(100.0, 5.0, 0.0))
    wanted = ClipSwings(expert, CONTROLLED, "cpu")(torch.tensor([[2.0, 0.0, 0.0], [0.5, 0.1, 0.0]]))
    end, moved = swings(expert, CONTROLLED)
    halves = [np.median(moved[half], axis=0) for half in (end < 5 * FPS, end >= 5 * FPS)]
    assert wanted.numpy() == pytest.approx(np.array(halves), rel=1e-3)
    stands = expert_of(_walking(100.0, 5.0, 0.0))
    assert torch.isinf(ClipSwings(stands, CONTROLLED, "cpu")(torch.zeros(2, 3))).all()


def _environment(count: int) -> SimpleNamespace:
    robot = SimpleNamespace(index=lambda names: np.array([CONTROLLED.index(name) for name in names]))
    context = SimpleNamespace(bundle=SimpleNamespace(robot=robot))
    return SimpleNamespace(context=context, num_envs=count, device="cpu")


def test_a_robots_stride_is_from_one_landing_of_its_foot_or_the_end_of_a_stand_to_the_next_landing():
    env = _environment(1)
    robots, found = LegSwings(env), {}
    left = [0.0, 0.5, 0.2, 0.3, 0.6, 0.4, 0.45, 0.5, 2.0, 0.3, 0.5, 0.4]
    lands, stands = {0: (1, 0), 2: (0, 1), 5: (1, 0), 7: (1, 0), 11: (1, 0)}, (8, 9)
    for at, angle in enumerate(left):
        joint_pos = torch.zeros(1, JOINTS)
        joint_pos[0, : len(NAMES)] = torch.tensor([2.0 * angle, -0.2 * at, angle, 0.1 * at])
        landed = torch.tensor([lands.get(at, (0, 0))], dtype=torch.bool)
        env.readings = SimpleNamespace(joint_pos=joint_pos, landed=landed)
        env.command = torch.tensor([[0.0, 0.0, 0.0 if at in stands else 0.5]])
        robots.advance()
        if robots.moved.any():
            found[at] = [round(value, 4) for value in robots.moved[0].tolist()]
    assert found == {2: [0.2, 0.4], 5: [0.6, 1.2], 7: [0.1, 0.2], 11: [0.2, 0.4]}


def test_another_episode_begins_without_the_last_ones_stride():
    robots, nobody, moves = LegSwings(_environment(2)), torch.zeros(2, 2, dtype=torch.bool), torch.ones(2).bool()
    robots.go_on(torch.full((2, 2, 2), 3.0), nobody, moves)
    robots.restart(torch.tensor([True, False]))
    robots.go_on(torch.zeros(2, 2, 2), ~nobody, moves)
    assert robots.moved.tolist() == [[0.0, 0.0], [3.0, 3.0]]


def test_what_share_of_the_clips_movement_is_paid():
    wanted = torch.tensor([[1.0, 0.5]]).expand(6, 2)
    shares = torch.tensor([0.2, 0.4, 0.65, 0.9, 2.0, 0.65])[:, None]
    assert terms.full_swing(shares * wanted, wanted).tolist() == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0, 0.5])
    one_of_two = torch.tensor([[0.9, 0.2]])
    assert float(terms.full_swing(one_of_two, wanted[:1])) == pytest.approx(0.5)
    assert float(terms.full_swing(one_of_two, torch.full((1, 2), torch.inf))) == 0.0


@pytest.mark.parametrize(("sigma2", "followed"), [(0.0, 1.0), (0.25, np.exp(-0.01 / 0.25))])
def test_a_step_is_paid_its_time_by_its_swing_as_far_as_the_command_is_followed(sigma2: float, followed: float):
    options = preset("paper_flat").changed(full_swing=2.0, long_step_sigma2=sigma2)
    (row,) = (row for row in table(options) if row.name == "full_swing")
    command = torch.tensor([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    env = SimpleNamespace(
        command=command,
        step_dt=0.02,
        step_times=lambda command: torch.full((4,), 0.4),
        clip_swings=lambda command: torch.tensor([[1.0, 1.0]]).expand(4, 2),
        leg_swings=SimpleNamespace(moved=torch.tensor([[0.9, 0.65], [0.9, 0.9], [0.9, 0.9], [0.0, 0.0]])),
        readings=SimpleNamespace(
            step_s=torch.tensor([0.3, 0.9, 0.3, 0.0]), mean_velocity=command + torch.tensor([0.1, 0.0, 0.0])
        ),
    )
    time_s = np.array([0.3 * 0.75, 0.6, 0.0, 0.0])
    assert row.weight * row.value(env) == pytest.approx(2.0 * time_s / 0.02 * followed, rel=1e-5)


def test_in_training_strides_are_seen_where_feet_land(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    env = AmpEnvironment(bundle, preset("long_steps").changed(full_swing=2.0), 6, "cpu", seed=1)
    env.reset()
    legs = env.leg_swings
    assert legs is not None
    generator, seen = torch.Generator().manual_seed(1), 0
    for _ in range(60):
        with torch.no_grad():
            env.step(torch.randn(6, JOINTS, generator=generator))
        landed = env.readings.landed.any(dim=1)
        assert (legs.moved[~landed] == 0.0).all()
        seen += int((legs.moved[landed] > 0.0).all(dim=1).sum())
    assert seen > 0
    assert AmpEnvironment(bundle, preset("long_steps"), 1, "cpu", seed=1).leg_swings is None
