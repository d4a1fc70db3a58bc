"""The clip that an episode began in: how near is told by joints and ends, and the clip's time goes with the robot's."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.training.bundle import ExpertFrames
from pipeline.training.followed_clip import AGAIN, FollowedClip

JOINTS = 21
PERIOD = 60


@pytest.fixture
def expert() -> ExpertFrames:
    """Two clips of 120 frames whose joints and ends go round in 60 frames."""
    angle = 2.0 * np.pi * np.arange(240) / PERIOD
    frames = np.zeros((240, 37 + 2 * JOINTS), dtype=np.float32)
    frames[:, 7 : 7 + JOINTS] = 0.4 * np.sin(angle[:, None] + np.arange(JOINTS))
    frames[:, 7 + JOINTS : 19 + JOINTS] = 0.1 * np.cos(angle[:, None] + np.arange(12))
    return ExpertFrames(
        frames=frames,
        command=np.ones((240, 3), dtype=np.float32),
        clip_start=np.array([0, 120, 240]),
        clip_weight=np.ones(2),
    )


def state(expert: ExpertFrames, at: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Joints and ends at a time between the frames, of one robot."""
    low = int(at)
    frame = expert.frames[low] + (at - low) * (expert.frames[low + 1] - expert.frames[low])
    values = torch.from_numpy(frame)[None]
    return values[:, 7 : 7 + JOINTS], values[:, 7 + JOINTS : 19 + JOINTS]


def followed(expert: ExpertFrames, rate: float, count: int, begin: int = 10) -> list[float]:
    """How near a robot is found that goes through the clip at a rate."""
    clip, keeps = FollowedClip(expert, 1, "cpu"), torch.tensor([True])
    clip.begin(torch.tensor([0]), torch.tensor([begin]), keeps)
    found = []
    for step in range(1, count + 1):
        clip.advance(*state(expert, begin + rate * step), keeps)
        found.append(float(clip.near[0]))
    return found


def test_who_does_what_the_clip_does_is_near_it(expert):
    assert followed(expert, 1.0, 80) == pytest.approx([1.0] * 80)


@pytest.mark.parametrize("rate", [0.8, 1.2])
def test_a_gait_of_nearly_the_clips_rate_stays_with_it(expert, rate):
    assert min(followed(expert, rate, 80)) > 0.85


def test_who_stands_still_is_left_behind(expert):
    assert followed(expert, 0.0, PERIOD // 2)[-1] < 0.2


def test_nearness_falls_with_joints_and_ends(expert):
    clip, ids = FollowedClip(expert, 1, "cpu"), torch.tensor([0])
    joints, ends = state(expert, 11.0)
    for away, wanted in (((0.5, 0.0), 1 / 1.5), ((0.0, 0.1), 1 / 1.2), ((0.5, 0.1), 1 / 1.7)):
        clip.begin(ids, torch.tensor([10]), torch.tensor([True]))
        shifted = joints.clone(), ends.clone()
        shifted[0][0, 3] += away[0]
        shifted[1][0, 5] += away[1]
        clip.advance(*shifted, torch.tensor([True]))
        assert clip.near.item() == pytest.approx(wanted, rel=1e-4)


def test_it_ends_with_the_clip_and_with_the_command_and_does_not_come_back(expert):
    assert followed(expert, 1.0, 30, begin=100)[-1] == 0.0, "the next clip is another one"
    clip, ids = FollowedClip(expert, 2, "cpu"), torch.arange(2)
    clip.begin(ids, torch.tensor([10, 119 - 25]), torch.tensor([True, True]))
    assert clip.left_s.tolist() == pytest.approx([1.0, 0.5]), "the end is told from a second before it"
    clip.begin(ids, torch.tensor([10, 10]), torch.tensor([True, False]))
    near = []
    for step, keeps in enumerate([True] * AGAIN + [False] + [True] * 3):
        joints, ends = state(expert, 11.0 + step)
        clip.advance(joints.expand(2, -1), ends.expand(2, -1), torch.tensor([keeps, True]))
        near.append(clip.near.tolist())
    assert [one for one, _ in near] == pytest.approx([1.0] * AGAIN + [0.0] * 4)
    assert [other for _, other in near] == [0.0] * len(near)
