"""Where exploration begins: the clips' walking posture, as the action that holds it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from torch import nn

from pipeline.learning.training_error import TrainingError
from pipeline.training.action import SCALE
from pipeline.training.bundle import ExpertFrames, read_bundle
from pipeline.training.first_posture import begin_at, first_action, walking_posture
from pipeline.training.options import Options
from tests.factories.training_bundle import small_bundle

JOINTS = 21


def expert(*clips: tuple[float, float, int]) -> ExpertFrames:
    """Clips of (forward command [m/s], every joint [rad], frames), all of one weight."""
    command = np.zeros((sum(count for *_, count in clips), 3), dtype=np.float32)
    command[:, 0] = np.concatenate([np.full(count, forward) for forward, _, count in clips])
    frames = np.zeros((len(command), 37 + 2 * JOINTS), dtype=np.float32)
    frames[:, 7 : 7 + JOINTS] = np.concatenate([np.full(count, joint) for _, joint, count in clips])[:, None]
    return ExpertFrames(
        frames=frames,
        command=command,
        clip_start=np.cumsum([0, *(count for *_, count in clips)]),
        clip_weight=np.ones(len(clips)),
    )


def test_only_clips_that_walk_count_and_long_ones_no_more_than_short_ones_of_their_cell():
    walked = expert((0.0, 5.0, 40), (1.0, 0.2, 30), (1.0, 0.6, 10))
    assert walking_posture(walked, Options(), 0) == pytest.approx(np.full(JOINTS, 0.4), abs=1e-6)


def test_each_speed_counts_as_often_as_it_is_asked_for():
    slow, fast = expert((0.3, 0.0, 20), (1.8, 1.0, 20)), Options(standing_share=0.0, fast_share=1.0)
    assert walking_posture(slow, fast, 0)[0] > 0.9


def test_without_a_clip_that_walks_there_is_no_such_posture():
    with pytest.raises(TrainingError, match="'init_posture' must be 'default'"):
        walking_posture(expert((0.0, 0.1, 20)), Options(), 0)


def test_the_first_action_holds_the_posture_joint_by_joint(tmp_path, root, robot):
    bundle = read_bundle(small_bundle(tmp_path, root, robot))
    frames = bundle.expert.frames.copy()
    frames[:, 7 : 7 + JOINTS] = np.arange(JOINTS) / 10.0
    bundle = dataclasses.replace(bundle, expert=dataclasses.replace(bundle.expert, frames=frames))
    target = dict(zip(bundle.robot.joint_names, bundle.robot.default_joint_pos, strict=True))
    for name, action in zip(bundle.robot.policy_joints, first_action(bundle, Options(), 0), strict=True):
        target[name] += SCALE * action
    wanted = dict(zip(bundle.robot.controlled, np.arange(JOINTS) / 10.0, strict=True))
    assert {name: target[name] for name in wanted} == pytest.approx(wanted, abs=1e-6)


def test_a_new_network_answers_with_it_on_average():
    torch.manual_seed(0)
    actor, action = nn.Sequential(nn.Linear(30, 64), nn.ELU(), nn.Linear(64, 3)), np.array([1.5, -0.5, 0.0])
    begin_at(actor, action)
    answers = actor(torch.randn(2000, 30)).detach()
    assert answers.mean(dim=0).numpy() == pytest.approx(action, abs=0.2)
