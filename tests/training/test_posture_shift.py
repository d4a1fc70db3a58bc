"""A teacher in another posture: what it sees and does, on both sides, how the shift ends, and texts that are none."""

from __future__ import annotations

import pytest
import torch

from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from pipeline.training.mirror import Mirror
from pipeline.training.posture_shift import MOST_RAD, PostureShift, fades_of, told_with
from tests.factories.training_bundle import small_bundle

FRAMES, SIZE, JOINTS = 10, 72, 21
TURNED = {"Left_Hip_Yaw": 0.09, "Right_Hip_Yaw": -0.09, "Left_Hip_Pitch": 0.05, "Right_Hip_Pitch": 0.05}
TEXT = "Left_Hip_Yaw:.09,Left_Hip_Pitch:.05"


@pytest.fixture(scope="module")
def facts(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("training"), root, robot)).robot


def seen_at(facts, forward: float, turned: dict[str, float]) -> torch.Tensor:
    """What an actor sees (1, o) with joints and what they were told turned [rad], all else some numbers."""
    frames = torch.randn(FRAMES, SIZE, generator=torch.Generator().manual_seed(3))
    frames[:, 6] = forward
    for name, angle in turned.items():
        at = facts.policy_joints.index(name)
        frames[:, 9 + at] += angle
        frames[:, 9 + 2 * JOINTS + at] += angle / 0.25
    return frames.reshape(1, -1)


def test_turned_legs_are_seen_as_straight_and_told_as_turned(facts):
    shift = PostureShift(TEXT, facts, "cpu")
    turned = seen_at(facts, 0.6, TURNED)
    by = shift.of(turned)
    torch.testing.assert_close(shift.seen_as(turned, by), seen_at(facts, 0.6, {}), rtol=0.0, atol=1e-5)
    told = told_with(torch.zeros(1, JOINTS), by)[0]
    wanted = {name: TURNED.get(name, 0.0) / 0.25 for name in facts.policy_joints}
    assert dict(zip(facts.policy_joints, told.tolist(), strict=True)) == pytest.approx(wanted)


def test_frames_from_before_the_episode_stay_as_they_are(facts):
    shift = PostureShift(TEXT, facts, "cpu")
    turned = seen_at(facts, 0.6, TURNED)
    turned[:, : 6 * SIZE] = 0.0
    seen = shift.seen_as(turned, shift.of(turned))
    assert (seen[:, : 6 * SIZE] == 0.0).all()
    torch.testing.assert_close(seen[:, 6 * SIZE :], seen_at(facts, 0.6, {})[:, 6 * SIZE :], rtol=0.0, atol=1e-5)


def test_the_mirror_image_of_a_shifted_robot_is_shifted_the_same(facts):
    shift = PostureShift("Left_Hip_Roll:.08,Left_Ankle_Roll:-.08,Left_Hip_Yaw:.09", facts, "cpu")
    mirror = Mirror(facts, "cpu")
    seen = seen_at(facts, 0.6, {"Left_Knee_Pitch": 0.2})
    by = shift.of(seen)
    torch.testing.assert_close(mirror.actions(by), by)
    torch.testing.assert_close(mirror.seen(shift.seen_as(seen, by)), shift.seen_as(mirror.seen(seen), by))


def test_it_ends_between_two_speeds(facts):
    shift = PostureShift(TEXT, facts, "cpu", (1.0, 1.5))
    at = facts.policy_joints.index("Left_Hip_Yaw")
    found = [float(shift.of(seen_at(facts, speed, {}))[0, at]) for speed in (-0.3, 0.6, 1.0, 1.25, 1.5, 2.0)]
    assert found == pytest.approx([0.09, 0.09, 0.09, 0.045, 0.0, 0.0])
    assert float(PostureShift(TEXT, facts, "cpu").of(seen_at(facts, 2.0, {}))[0, at]) == pytest.approx(0.09)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Left_Hip_Yaw", "it must look like"),
        ("Left_Hip_Yaw:wide", "it must look like"),
        ("", "it must look like"),
        ("Left_Hip:.1", "names 'Left_Hip', which the policy does not move; it moves Left_Shoulder_Pitch"),
        (f"Left_Hip_Yaw:-{MOST_RAD + 0.01}", "is -0.31 rad; it must be from -0.3 to 0.3"),
        ("Left_Hip_Yaw:nan", "is nan rad; it must be from -0.3 to 0.3"),
        (":.1", "it must look like"),
        ("Waist:.1", "names 'Waist', which is its own mirror image"),
        ("Left_Hip_Yaw:.09,Left_Hip_Yaw:.05", "names 'Left_Hip_Yaw' twice"),
        ("Left_Hip_Yaw:.09, Right_Hip_Yaw:.09", "names 'Right_Hip_Yaw' and 'Left_Hip_Yaw', its mirror image"),
    ],
)
def test_what_is_no_shift_is_refused(facts, text, told):
    with pytest.raises(TrainingError, match=told):
        PostureShift(text, facts, "cpu")


@pytest.mark.parametrize("text", ["1.1", "a:b", "1.5:1.1", "1:1", "-1:1", "1:inf", "nan:1"])
def test_speeds_at_which_it_can_t_end_are_refused(text):
    with pytest.raises(TrainingError, match=r"--shift-fades is .*; it must (be two speeds|look like)"):
        fades_of(text)


def test_speeds_at_which_it_ends_are_read():
    assert fades_of("1.05:1.5") == (1.05, 1.5)
