"""Teachers of one network: what they say of a state, what they are told, and which files are none."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pipeline.learning.policy_file import act, write_policy
from pipeline.learning.training_error import TrainingError
from pipeline.training.bundle import read_bundle
from pipeline.training.mirror import Mirror
from pipeline.training.roles import ROLES
from pipeline.training.teachers import Teachers
from pipeline.training.walked_speeds import corrected
from tests.factories.training_bundle import small_bundle

SEEN, TOLD = 720, 21


@pytest.fixture(scope="module")
def facts(tmp_path_factory, root, robot):
    return read_bundle(small_bundle(tmp_path_factory.mktemp("training"), root, robot)).robot


def policy(facts, seed: int, hidden: tuple[int, ...] = (8, 5)) -> dict[str, np.ndarray]:
    """A policy of random numbers with the robot's gains."""
    rng = np.random.default_rng(seed)
    sizes = (SEEN, *hidden, TOLD)
    arrays = {"mean": rng.normal(size=SEEN), "std": rng.uniform(0.5, 2.0, SEEN), "eps": np.array(1e-2)}
    for number, (into, out) in enumerate(pairwise(sizes)):
        arrays |= {f"L{number}_w": rng.normal(size=(out, into)) / into**0.5, f"L{number}_b": rng.normal(size=out)}
    arrays = {name: value if name == "eps" else value.astype(np.float32) for name, value in arrays.items()}
    gains = {name: getattr(facts, name) for name in ("kp", "kd", "default_joint_pos")}
    return {**arrays, **gains, "joint_names": np.array(facts.joint_names)}


def written(folder, facts, *roles: str, hidden: tuple[int, ...] = (8, 5)):
    """A policy of its own for each role, and its file."""
    arrays = {role: policy(facts, seed, hidden) for seed, role in enumerate(roles)}
    paths = {role: folder / f"{role}.npz" for role in roles}
    for role in roles:
        write_policy(paths[role], arrays[role])
    return arrays, paths


def test_slopes_are_told_apart_where_they_have_a_teacher(facts, tmp_path):
    _, paths = written(tmp_path, facts, "other", "sloped")
    env = SimpleNamespace(slopes=SimpleNamespace(level=torch.tensor([True, False])))
    teachers = Teachers(paths, facts, "cpu")
    assert teachers.sloped(env).tolist() == [False, True]
    assert teachers.sloped(SimpleNamespace(slopes=None)) is None
    assert Teachers({"other": paths["other"]}, facts, "cpu").sloped(env) is None


def test_what_the_velocity_lacks_is_told_to_those_who_are_corrected_alone(facts, tmp_path):
    arrays, paths = written(tmp_path, facts, "other", "ahead")
    seen = torch.randn(2, SEEN, generator=torch.Generator().manual_seed(7))
    error = torch.tensor([[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    told = Teachers(paths, facts, "cpu", with_error=("ahead",)).act(seen, torch.tensor([0, 1]), error)
    torch.testing.assert_close(told[0], act(arrays["other"], seen[:1])[0], rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(told[1], act(arrays["ahead"], corrected(seen, error)[1:])[0], rtol=1e-5, atol=1e-5)
    with pytest.raises(TrainingError, match="--with-error names 'fast', which has no --teacher"):
        Teachers(paths, facts, "cpu", with_error=("fast",))


def test_who_goes_beyond_does_more_of_what_the_teacher_of_pushes_does_not(facts, tmp_path):
    """By hand: a tenth of the way from that one's answer to its own, on top; corrected and on both sides as ever."""
    arrays, paths = written(tmp_path, facts, "other", "ahead", "pushed")
    seen = torch.randn(3, SEEN, generator=torch.Generator().manual_seed(11))
    roles = torch.tensor([ROLES.index(name) for name in ("other", "ahead", "pushed")])
    error = torch.tensor([[0.1, 0.0, 0.0]] * 3)
    asked = {"with_error": ("ahead",), "both_sides": ("ahead",)}
    own = Teachers(paths, facts, "cpu", **asked).act(seen, roles, error)
    told = Teachers(paths, facts, "cpu", **asked, beyond={"ahead": 0.1}).act(seen, roles, error)
    pushed = act(arrays["pushed"], seen[1:2])[0]
    assert (own[1] - pushed).abs().max() > 0.1
    torch.testing.assert_close(told[1], own[1] + 0.1 * (own[1] - pushed), rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(told[[0, 2]], own[[0, 2]])


@pytest.mark.parametrize(
    ("taught", "beyond", "told"),
    [
        (("other", "pushed"), {"fast": 0.1}, "--beyond names 'fast', which has no --teacher of its own"),
        (("other", "ahead"), {"ahead": 0.1}, "away from what --teacher pushed=POLICY does; give that too"),
        (("other", "pushed"), {"pushed": 0.1}, "--beyond names 'pushed', from which the others go away"),
        (("other", "pushed"), {"other": -0.1}, "--beyond of 'other' is -0.1; it must be from 0 to 0.3"),
        (("other", "pushed"), {"other": float("nan")}, "--beyond of 'other' is nan"),
    ],
)
def test_who_cannot_go_beyond_is_refused(facts, tmp_path, taught, beyond, told):
    _, paths = written(tmp_path, facts, *taught)
    with pytest.raises(TrainingError, match=told):
        Teachers(paths, facts, "cpu", beyond=beyond)


@pytest.mark.parametrize(
    "own",
    [
        ROLES,
        ("pushed", "other"),
        ("other", "fast"),
        ("other", "run", "ahead"),
        ("other", "standing"),
        ("ahead", "other"),
        ("other",),
    ],
)
def test_a_role_is_answered_by_its_own_policy_or_by_that_which_stands_in(facts, tmp_path, own):
    arrays, paths = written(tmp_path, facts, *own)
    seen = 2.0 * torch.randn(40, SEEN, generator=torch.Generator().manual_seed(4))
    role = torch.arange(40) % len(ROLES)
    told = Teachers(paths, facts, "cpu").act(seen, role)
    for number, place in enumerate(role.tolist()):
        asked = {"run": ("run", "fast", "ahead"), "fast": ("fast", "ahead")}.get(ROLES[place], (ROLES[place],))
        of_role = arrays[next((each for each in asked if each in own), "other")]
        torch.testing.assert_close(told[number], act(of_role, seen[number : number + 1])[0], rtol=1e-5, atol=1e-5)


def test_who_walks_too_fast_is_told_less(facts, tmp_path):
    arrays, paths = written(tmp_path, facts, "other", "ahead")
    seen = torch.randn(2, SEEN, generator=torch.Generator().manual_seed(5))
    slower = seen.clone()
    for frame in range(10):
        seen[:, 72 * frame + 6], slower[:, 72 * frame + 6] = 0.6 + 0.01 * frame, 0.5 + 0.01 * frame / 1.2
    told = Teachers(paths, facts, "cpu", {"ahead": ".5:.6,1.0:1.2"}).act(seen, torch.tensor([0, 1]))
    torch.testing.assert_close(told[0], act(arrays["other"], seen[:1])[0], rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(told[1], act(arrays["ahead"], slower[1:])[0], rtol=1e-5, atol=1e-5)


def test_a_teacher_of_both_sides_answers_alike_on_both(facts, tmp_path):
    _, paths = written(tmp_path, facts, "other", "ahead")
    teachers, mirror = Teachers(paths, facts, "cpu", None, ("ahead",)), Mirror(facts, "cpu")
    seen = torch.randn(4, SEEN, generator=torch.Generator().manual_seed(6))
    for role, alike in ((1, True), (0, False)):
        place = torch.full((4,), role)
        told, other = teachers.act(seen, place), mirror.actions(teachers.act(mirror.seen(seen), place))
        assert torch.allclose(told, other, atol=1e-5) == alike
    plain = Teachers(paths, facts, "cpu").act(seen, torch.ones(4, dtype=torch.long))
    mean = 0.5 * (plain + mirror.actions(Teachers(paths, facts, "cpu").act(mirror.seen(seen), torch.ones(4).long())))
    torch.testing.assert_close(teachers.act(seen, torch.ones(4).long()), mean, rtol=1e-5, atol=1e-5)


def test_a_policy_without_inner_layers_can_teach(facts, tmp_path):
    arrays, paths = written(tmp_path, facts, "other", hidden=())
    seen = torch.ones(2, SEEN)
    told = Teachers(paths, facts, "cpu").act(seen, torch.tensor([0, 3]))
    torch.testing.assert_close(told, act(arrays["other"], seen), rtol=1e-5, atol=1e-5)


def test_roles_that_are_none_and_no_teacher_for_the_rest_are_refused(facts, tmp_path):
    _, paths = written(tmp_path, facts, "other", "ahead")
    with pytest.raises(TrainingError, match="--teacher names 'behind'; roles are other, ahead, fast, run, sloped"):
        Teachers({**paths, "behind": paths["ahead"]}, facts, "cpu")
    with pytest.raises(TrainingError, match="--walks names 'fast', which has no --teacher"):
        Teachers(paths, facts, "cpu", {"fast": "1:1"})
    with pytest.raises(TrainingError, match="--both-sides names 'pushed', which has no --teacher"):
        Teachers(paths, facts, "cpu", None, ("pushed",))
    with pytest.raises(TrainingError, match="--teacher other=POLICY is needed"):
        Teachers({"ahead": paths["ahead"]}, facts, "cpu")
    with pytest.raises(TrainingError, match=r"gone\.npz: can't be read"):
        Teachers({**paths, "pushed": tmp_path / "gone.npz"}, facts, "cpu")


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("kp", np.full(23, 7.0), "kp of 'AAHead_yaw' is 7, the robot's"),
        ("kd", np.ones(5), r"kd is \(5,\)"),
        ("joint_names", "reversed", "another order, or others"),
        ("joint_names", None, "lacks joint_names"),
        ("L1_b", np.full(5, np.nan), "'L1_b' is not of finite numbers"),
        ("mean", None, "lacks mean; it is no policy of ours"),
        ("L0_w", None, "lacks L0_w; it is no policy of ours"),
        ("L1_b", None, "lacks L1_b"),
        ("mean", np.zeros(719), r"'mean' is \(719,\); it must be \(720,\)"),
        ("std", np.ones((1, 720)), r"'std' is \(1, 720\); it must be \(720,\)"),
        ("std", np.full(720, -1e-2), "'std' and 'eps' must be over 0 together"),
        ("L0_w", np.zeros((8, 690)), r"'L0_w' is \(8, 690\); it must be \(8, 720\), of an actor that sees 720"),
        ("L0_b", np.zeros(7), r"'L0_b' is \(7,\); it must be \(8,\)"),
        ("L1_w", np.zeros((5, 9)), r"'L1_w' is \(5, 9\); it must be \(5, 8\)"),
        ("L1_w", np.array(1.0), r"'L1_w' is \(\); it must be \(1, 8\)"),
        ("L2_w", np.zeros((23, 5)), r"'L2_w' is \(23, 5\); it must be \(21, 5\), .* moves 21 joints"),
        ("L2_b", np.zeros(23), r"'L2_b' is \(23,\); it must be \(21,\)"),
    ],
)
def test_a_file_that_can_not_teach_is_refused_by_its_name(facts, tmp_path, name, value, told):
    arrays, paths = written(tmp_path, facts, "other", "pushed")
    wrong = dict(arrays["pushed"])
    wrong[name] = wrong[name][::-1] if isinstance(value, str) else value
    if value is None:
        del wrong[name]
    write_policy(paths["pushed"], wrong)
    with pytest.raises(TrainingError, match=told) as error:
        Teachers(paths, facts, "cpu")
    assert str(error.value).startswith(f"{paths['pushed']}: ")


def test_teachers_of_another_robot_are_refused(facts, tmp_path):
    """A robot of one policy joint less is seen by 30 numbers less."""
    _, paths = written(tmp_path, facts, "other")
    fewer = dataclasses.replace(facts, policy_joints=facts.policy_joints[1:], controlled=facts.controlled[1:])
    with pytest.raises(TrainingError, match=r"'mean' is \(720,\); it must be \(690,\)"):
        Teachers(paths, fewer, "cpu")
