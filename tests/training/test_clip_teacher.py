"""Arms that the clips teach: bent as theirs at the commanded speed, wherever they are."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.action import SCALE
from pipeline.training.bundle import ExpertFrames, read_bundle
from pipeline.training.clip_teacher import ASTRAY, LEAST, ClipTeacher
from tests.factories.training_bundle import small_bundle

BENT = {0.6: 0.3, 1.5: -1.2}
"""Where elbows are on average in the clip of a speed [rad]."""


@pytest.fixture(scope="module")
def facts(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("arms"), root, robot)).robot


@pytest.fixture
def teacher(facts) -> ClipTeacher:
    return ClipTeacher(cast(Any, environment(facts, 300)), ("Elbow",))


def environment(facts, count: int) -> Any:
    """What the teacher reads of one: a clip for each speed, in which elbows swing about where they are bent, and one
    to the side in which they are elsewhere."""
    joints, frames = len(facts.controlled), 2 * LEAST
    swing = 0.2 * np.sin(2.0 * np.pi * np.arange(frames) / 50)
    clips = np.zeros((3 * frames, 37 + 2 * joints), dtype=np.float32)
    for number, bent in enumerate((*BENT.values(), 9.0)):
        for at, name in enumerate(facts.controlled):
            clips[number * frames : (number + 1) * frames, 7 + at] = swing + bent if "Elbow" in name else 5.0
    command = np.zeros((3 * frames, 3), dtype=np.float32)
    command[:, 0] = np.repeat([*BENT, 0.6], frames)
    command[2 * frames :, 1] = 0.4
    expert = ExpertFrames(frames=clips, command=command, clip_start=frames * np.arange(4), clip_weight=np.ones(3))
    return SimpleNamespace(
        context=SimpleNamespace(bundle=SimpleNamespace(robot=facts, expert=expert)), device="cpu", num_envs=count
    )


def elbows(facts) -> list[int]:
    """Where they are in an action."""
    return [at for at, name in enumerate(facts.policy_joints) if "Elbow" in name]


def bent_at(facts, teacher: ClipTeacher, speed: float) -> np.ndarray:
    """Where elbows are told to be [rad] at a forward command."""
    told = torch.full((1, len(facts.policy_joints)), 7.0)
    found = teacher.tell(told, torch.tensor([[speed, 0.0, 0.0]]), torch.tensor([True]))[0, elbows(facts)].numpy()
    names = tuple(facts.policy_joints[at] for at in elbows(facts))
    return facts.default_joint_pos[facts.index(names)] + SCALE * found


@pytest.mark.parametrize(("speed", "bent"), [*BENT.items(), (0.2, 0.3), (0.4, 0.3), (2.0, -1.2), (9.0, -1.2)])
def test_elbows_are_where_the_clips_have_them_at_that_speed(facts, teacher, speed, bent):
    assert len(elbows(facts)) == 4
    assert bent_at(facts, teacher, speed) == pytest.approx(bent, abs=1e-4)


def test_between_speeds_they_bend_by_and_by(facts, teacher):
    told = np.array([bent_at(facts, teacher, speed)[0] for speed in np.arange(0.6, 1.51, 0.025)])
    assert (np.diff(told) <= 1e-6).all()
    assert bent_at(facts, teacher, 1.04)[0] == pytest.approx(
        0.6 * bent_at(facts, teacher, 1.0)[0] + 0.4 * bent_at(facts, teacher, 1.1)[0], abs=1e-4
    )


def test_other_joints_and_who_is_not_ahead_are_told_what_they_were(facts, teacher):
    told = torch.randn(2, len(facts.policy_joints), generator=torch.Generator().manual_seed(1))
    found = teacher.tell(told, torch.tensor([[0.6, 0.0, 0.0]] * 2), torch.tensor([True, False]))
    others = [at for at in range(told.shape[1]) if at not in elbows(facts)]
    assert torch.equal(found[:, others], told[:, others])
    assert torch.equal(found[1], told[1])
    assert not torch.isclose(found[0, elbows(facts)], told[0, elbows(facts)]).any()


def test_a_third_move_them_as_the_next_is_told_and_nobody_its_legs(facts, teacher):
    torch.manual_seed(2)
    told = torch.randn(300, len(facts.policy_joints))
    others = [at for at in range(told.shape[1]) if at not in elbows(facts)]
    shares = []
    for _ in range(400):
        done = teacher.done(told, told)
        assert torch.equal(done[:, others], told[:, others])
        astray = (done != told).any(dim=1)
        assert torch.equal(done[astray][:, elbows(facts)], told.roll(1, dims=0)[astray][:, elbows(facts)])
        shares.append(float(astray.float().mean()))
    assert shares[0] < 0.05, "at first nobody does"
    assert np.mean(shares[200:]) == pytest.approx(ASTRAY, abs=0.05)


def test_a_part_of_no_joints_name_is_refused(facts):
    with pytest.raises(TrainingError, match="--clip-joint is 'Tail', which no joint has in its name: "):
        ClipTeacher(cast(Any, environment(facts, 1)), ("Elbow", "Tail"))
