"""How far hip and knee move in a stride of the clips and of robots, and what is paid for it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pipeline.training import reward_terms as terms
from pipeline.training.bundle import FPS, read_bundle
from pipeline.training.environment import AmpEnvironment
from pipeline.training.leg_swings import JOINTS, SIDES, ClipSwings, LegSwings, swings
from pipeline.training.presets import preset
from pipeline.training.reward_table import table
from tests.factories.expert_frames import expert_of
from tests.factories.training_bundle import small_bundle

COUNT = 21
FOOT = 7 + COUNT + 6
HIP_RAD, KNEE_RAD = 0.4, 0.3
NAMES = tuple(f"{side}_{joint}" for joint in reversed(JOINTS) for side in SIDES)
CONTROLLED = (*NAMES, *(f"joint_{number}" for number in range(COUNT - len(NAMES))))
"""The joints of the frames: knees first, then hips."""


def _walking(step_s: float, seconds: float, speed: float, size: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Frames and commands of a robot that lifts its feet by turns; hips and knees swing by +- HIP_RAD and KNEE_RAD, the
    left leg's by a fifth more, the right leg's by a fifth less."""
    count = round(seconds * FPS)
    frames = np.zeros((count, 37 + 2 * COUNT), dtype=np.float32)
    frames[:, 2], frames[:, 3] = 0.7, 1.0
    frames[:, [FOOT + 2, FOOT + 5]] = -0.7
    turn = np.arange(count) // round(step_s * FPS) % 2
    for foot in (0, 1):
        frames[turn == foot, FOOT + 3 * foot + 2] += 0.05
    phase = np.pi * np.arange(count) / round(step_s * FPS)
    for column, (rad, leg, ahead) in enumerate(
        ((KNEE_RAD, 1.2, 0.0), (KNEE_RAD, 0.8, np.pi), (HIP_RAD, 1.2, 0.0), (HIP_RAD, 0.8, np.pi))
    ):
        frames[:, 7 + column] = size * rad * leg * np.cos(phase + ahead)
    command = np.zeros((count, 3), dtype=np.float32)
    command[:, 0] = speed
    return frames, command


def test_strides_of_clips_move_hip_and_knee_from_one_end_to_the_other():
    end, moved = swings(expert_of(_walking(0.4, 4.0, 1.0), _walking(0.6, 6.0, 0.6, size=2.0)), CONTROLLED)
    slow = end >= 4.0 * FPS
    assert moved[~slow] == pytest.approx(np.tile([2 * HIP_RAD, 2 * KNEE_RAD], ((~slow).sum(), 1)), rel=0.01)
    assert moved[slow] == pytest.approx(np.tile([4 * HIP_RAD, 4 * KNEE_RAD], (slow.sum(), 1)), rel=0.01)
    assert (~slow).sum() >= 6 and slow.sum() >= 6


def test_no_stride_reaches_into_the_clip_before():
    one, other = _walking(0.4, 4.0, 1.0), _walking(0.4, 4.0, 1.0)
    other[0][:, 7 : 7 + len(NAMES)] = 5.0
    end, moved = swings(expert_of(one, other), CONTROLLED)
    assert (moved[end >= 4.0 * FPS] == 0.0).all()
    assert (moved[end < 4.0 * FPS] < 1.0).all()


def test_a_command_is_answered_by_the_strides_of_the_nearest_clips():
    expert = expert_of(_walking(0.4, 4.0, 1.5), _walking(0.6, 6.0, 0.6, size=0.5), _walking(100.0, 5.0, 0.0))
    wanted = ClipSwings(expert, CONTROLLED, "cpu")(torch.tensor([[2.0, 0.0, 0.0], [0.5, 0.1, 0.0]]))
    assert wanted.tolist() == pytest.approx(np.array([[0.8, 0.6], [0.4, 0.3]]), rel=0.01)
    stands = expert_of(_walking(100.0, 5.0, 0.0))
    assert torch.isinf(ClipSwings(stands, CONTROLLED, "cpu")(torch.zeros(2, 3))).all()


def _robots(count: int) -> LegSwings:
    robot = SimpleNamespace(index=lambda names: np.arange(len(names)))
    context = SimpleNamespace(bundle=SimpleNamespace(robot=robot))
    return LegSwings(SimpleNamespace(context=context, num_envs=count, device="cpu"))


def test_a_robots_stride_is_from_one_landing_of_its_foot_to_the_next():
    robots, found = _robots(1), []
    left = [0.0, 0.5, 0.2, 0.3, 0.6, 0.4]
    landed = [(1, 0), (0, 0), (0, 1), (0, 0), (0, 0), (1, 0)]
    for at, feet in enumerate(landed):
        joints = torch.tensor([[[left[at], 2.0 * left[at]], [0.1 * at, -0.2 * at]]])
        robots.go_on(joints, torch.tensor([feet], dtype=torch.bool), torch.ones(1, dtype=torch.bool))
        found.append([round(value, 4) for value in robots.moved[0].tolist()])
    assert found == [[0, 0], [0, 0], [0.2, 0.4], [0, 0], [0, 0], [0.6, 1.2]]


def test_another_episode_begins_without_the_last_ones_stride():
    robots, nobody, moves = _robots(2), torch.zeros(2, 2, dtype=torch.bool), torch.ones(2, dtype=torch.bool)
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
            env.step(torch.randn(6, COUNT, generator=generator))
        landed = env.readings.landed.any(dim=1)
        assert (legs.moved[~landed] == 0.0).all()
        seen += int((legs.moved[landed] > 0.0).all(dim=1).sum())
    assert seen > 0
    assert AmpEnvironment(bundle, preset("long_steps"), 1, "cpu", seed=1).leg_swings is None
