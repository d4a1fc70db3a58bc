"""Teachers of one network: whose a state is, what they say of it, which files are none, and what is remembered."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from pipeline.training.bundle import read_bundle
from pipeline.training.mirror import Mirror
from pipeline.training.policy_file import act, write_policy
from pipeline.training.pushes import ComingPush, since_push
from pipeline.training.taught_memory import TaughtMemory
from pipeline.training.teachers import ROLES, Borders, Teachers, Unsteadiness, is_of, role_of
from pipeline.training.training_error import TrainingError
from pipeline.training.walked_speeds import corrected
from tests.factories.training_bundle import small_bundle

SEEN, TOLD = 720, 21
LONG_AGO = math.inf
STANDS = torch.zeros(4, 3)


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
    everyone = role_of(command, long_ago, Borders(), STANDS)
    assert [ROLES[place] for place in everyone.tolist()] == ["fast", "fast", "ahead", "other"]


def test_a_run_begins_where_it_is_said_and_nowhere_unless_it_is():
    command = torch.tensor([[1.19, 0.0, 0.0], [1.2, 0.0, 0.0], [1.75, 0.0, 0.0], [2.0, 0.0, 1.5]])
    long_ago = torch.full((4,), LONG_AGO)
    found = role_of(command, long_ago, Borders(fast_m_s=1.2, run_m_s=1.75), STANDS)
    assert [ROLES[place] for place in found.tolist()] == ["ahead", "fast", "run", "other"]
    assert is_of(found, ("ahead", "fast")).tolist() == [True, True, False, False]
    assert "run" not in [ROLES[place] for place in role_of(command, long_ago, Borders(), STANDS).tolist()]
    below = role_of(command, long_ago, Borders(fast_m_s=1.2, run_m_s=1.0), STANDS)
    assert [ROLES[place] for place in below.tolist()] == ["ahead", "run", "run", "other"], "a run is fast"


def test_on_slopes_who_is_of_has_a_role_of_its_own_where_it_has_a_teacher(facts, tmp_path):
    command = torch.tensor([[0.6, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0], [0.6, 0.0, 0.0]])
    since_s, slopes = torch.tensor([LONG_AGO] * 4 + [0.1]), torch.tensor([True] * 5)
    found = role_of(command, since_s, Borders(), torch.zeros(5, 3), slopes)
    assert [ROLES[place] for place in found.tolist()] == ["sloped", "sloped", "other", "standing", "pushed"]
    found = role_of(command, since_s, Borders(), torch.zeros(5, 3), ~slopes)
    assert [ROLES[place] for place in found.tolist()] == ["ahead", "fast", "other", "standing", "pushed"]
    _, paths = written(tmp_path, facts, "other", "sloped")
    env = SimpleNamespace(slopes=SimpleNamespace(level=torch.tensor([True, False])))
    teachers = Teachers(paths, facts, "cpu")
    assert teachers.sloped(env).tolist() == [False, True]
    assert teachers.sloped(SimpleNamespace(slopes=None)) is None
    assert Teachers({"other": paths["other"]}, facts, "cpu").sloped(env) is None


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


def test_what_the_velocity_lacks_is_told_to_those_who_are_corrected_alone(facts, tmp_path):
    arrays, paths = written(tmp_path, facts, "other", "ahead")
    seen = torch.randn(2, SEEN, generator=torch.Generator().manual_seed(7))
    error = torch.tensor([[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]])
    told = Teachers(paths, facts, "cpu", with_error=("ahead",)).act(seen, torch.tensor([0, 1]), error)
    torch.testing.assert_close(told[0], act(arrays["other"], seen[:1])[0], rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(told[1], act(arrays["ahead"], corrected(seen, error)[1:])[0], rtol=1e-5, atol=1e-5)
    with pytest.raises(TrainingError, match="--with-error names 'fast', which has no --teacher"):
        Teachers(paths, facts, "cpu", with_error=("fast",))


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


def states(*values: int) -> tuple[torch.Tensor, torch.Tensor]:
    """State v: 2 v and 2 v + 1 are seen of it, 10 v is told."""
    value = torch.tensor(values, dtype=torch.float32)[:, None]
    return torch.cat([2.0 * value, 2.0 * value + 1.0], dim=1), 10.0 * value


def held(memory: TaughtMemory) -> set[int]:
    """The states that can be drawn, of many draws."""
    seen, told = memory.drawn(400)
    assert seen.dtype == told.dtype == torch.float32
    value = told[:, 0] / 10.0
    assert torch.equal(seen, torch.stack([2.0 * value, 2.0 * value + 1.0], dim=1))
    return set(value.int().tolist())


def test_the_newest_states_are_remembered():
    torch.manual_seed(0)
    memory = TaughtMemory(5, 2, 1, "cpu")
    for added, filled, kept in (
        ((1, 2), 2, {1, 2}),
        ((3, 4), 4, {1, 2, 3, 4}),
        ((5, 6), 5, {2, 3, 4, 5, 6}),
        ((7, 8, 9), 5, {5, 6, 7, 8, 9}),
        (tuple(range(10, 22)), 5, {17, 18, 19, 20, 21}),
        ((22,), 5, {18, 19, 20, 21, 22}),
    ):
        memory.add(*states(*added))
        assert memory.filled == filled
        assert held(memory) == kept


def test_any_state_is_as_likely_as_any_other():
    torch.manual_seed(0)
    memory = TaughtMemory(50, 2, 1, "cpu")
    memory.add(*states(1, 2, 3, 4))
    _, told = memory.drawn(4000)
    counts = torch.bincount(told[:, 0].long() // 10, minlength=5).tolist()
    assert counts[0] == 0 and min(counts[1:]) > 900


def pushed_env(pushed: tuple[bool, ...], *kinds_m_s: float) -> SimpleNamespace:
    """A stand-in whose robots are pushed by each kind in turn, at .1 s, .2 s and so on."""
    env = SimpleNamespace(num_envs=len(pushed), device="cpu", step_dt=0.02, pushed=torch.tensor(pushed))
    options = SimpleNamespace(push_interval_s=(5.0, 5.0), push_least=0.2, push_sagittal=0.0, tracked_pushed=True)
    env.context, env.readings, env.tracked_clip = SimpleNamespace(options=options), SimpleNamespace(), None
    env.coming_pushes, env.restarts = [], []
    for kind, largest in enumerate(kinds_m_s):
        ComingPush(env, torch.tensor(largest)).left_s[:] = 0.1 * (kind + 1) - 0.01
    return env


def test_the_time_since_a_push_is_that_of_the_latest_of_any_kind():
    env = pushed_env((True, False), 1.0, 2.0)
    found = []
    for _ in range(15):
        for coming in env.coming_pushes:
            coming.begins()
        found.append(since_push(env)[0].item())
        assert since_push(env)[1] == math.inf
    assert found[:4] == [math.inf] * 4
    wanted = [0.02 * (step % 5) for step in range(10)] + [0.1]
    assert found[4:] == pytest.approx(wanted, abs=1e-6)
    for restart in env.restarts:
        restart(torch.tensor([True, False]))
    assert since_push(env).tolist() == [math.inf] * 2


def test_without_pushes_the_time_since_one_is_without_end():
    assert since_push(pushed_env((True, True, True))).tolist() == [math.inf] * 3


def test_a_push_of_nothing_is_none():
    env = pushed_env((True,), 0.0)
    for _ in range(8):
        env.coming_pushes[0].begins()
    assert since_push(env).tolist() == [math.inf]
