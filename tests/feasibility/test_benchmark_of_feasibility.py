"""The benchmark of feasibility: falls are told, rates are of what walked, a fault is found by what is new."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import benchmarks.feasibility as benchmark
from benchmarks.feasibility_faults import FAULTS, LABELS, displacement, matters
from benchmarks.feasibility_judge import (
    SWAPPED,
    Judged,
    commands_on_axes,
    drawn_commands,
    judge,
    policy_file,
    stands,
)
from benchmarks.feasibility_rates import criteria, fault_bars, group_of, known_good_bars, rate
from pipeline import rotation
from pipeline.feasibility import FeasibilitySettings, assess
from pipeline.feasibility.criterion import groups
from pipeline.feasibility.motion import motion_of
from pipeline.files import settings
from pipeline.robot import Robot
from tests.factories.robot_clips import standing


def test_rollouts_that_fell_are_told_and_not_counted_as_known_good():
    good, cut = Judged(labelled=(True, 1.0)), Judged(labelled=(False, 0.5), broken={"foot_slip_p95"})
    bars = {bar.name: bar for bar in known_good_bars([good, cut, Judged(fell=True)], ["foot_slip_p95"])}
    assert bars["known-good rollouts"].value == 2
    assert bars["rollouts that fell, left out"].value == 1
    assert bars["known good: accepted whole (1 of 2)"].value == 50.0
    assert bars["known good: accepted whole, contacts not labelled (0 of 2)"].value == 0.0
    assert bars["known good: seconds accepted"].value == 75.0
    assert bars["known good: hold foot_slip_p95, labels of any kind or none"].value == 50.0


def test_a_fault_that_no_criterion_tells_is_a_miss():
    told, missed = Judged(found={"teleport": {"root_speed"}}), Judged(found={"teleport": set()})
    bars = {bar.name: bar for bar in fault_bars([told, told, told, missed])}
    assert bars["found: teleport (3 of 4)"].value == 75.0
    assert bars["found: teleport (3 of 4)"].holds is False
    assert bars["    by root_speed"].value == 75.0
    assert bars["    by root motion"].value == 75.0
    assert bars["root motion: found, of 4 made for it"].value == 75.0


def test_every_criterion_has_its_rate_on_known_good_motion_and_on_plants_made_for_its_group():
    fault_of = {group_of(fault): fault for fault in FAULTS}
    elsewhere = {"tracking stability", "likeness to the person", "length"}  # tables of their own; refused by its length
    elsewhere |= {"torque", "contact forces"}  # of what a simulation recorded, which these walks are judged without
    assert set(fault_of) == set(groups()) - elsewhere
    good = {bar.name for bar in known_good_bars([Judged()], criteria())}
    planted = {bar.name for bar in fault_bars([Judged(found={fault: set() for fault in fault_of.values()})])}
    for code in criteria():
        assert f"known good: hold {code}, labels of any kind or none" in good
        assert f"    by {code}" in planted


def test_a_plant_that_moves_no_body_by_five_centimetres_is_told_and_not_counted():
    small = {bar.name: bar.value for bar in fault_bars([Judged(small=["teleport"]), Judged(small=["teleport"])])}
    assert small == {"too small to matter, left out: teleport": 2}


def test_a_fault_that_was_asked_for_and_planted_nowhere_is_not_measured_and_holds_no_bar():
    judged = [Judged(found={"spun": {"root_turn_speed"}}, small=["teleport"])]
    bars = {bar.name: bar for bar in fault_bars(judged, ["spun", "teleport", LABELS])}
    assert bars["found: spun (1 of 1)"].holds
    for unmeasured in ("spun, no labels", "teleport", "teleport, KP2's labels", LABELS):
        assert bars[f"found: {unmeasured} (0 of 0): not measured"].holds is False
    assert f"found: {LABELS}, no labels (0 of 0): not measured" not in bars, "there are no labels to exchange"
    assert fault_bars([]) == [], "nothing was asked for"


def test_rates_say_how_many_of_how_many_and_a_miss_fails():
    judged = [Judged(labelled=(True, 1.0), windows=[True, False], found={"spun": set()})]
    bars = {bar.name: bar.holds for bar in (*known_good_bars(judged, []), *fault_bars(judged, ["spun"]))}
    assert bars["known good: accepted whole (1 of 1)"] is True
    assert bars["known good: windows of 0.5 s accepted (1 of 2)"] is False
    assert bars["found: spun (0 of 1)"] is False


def test_a_rate_of_nothing_is_not_measured():
    for least in (98.0, None):
        bar = rate("known good", [], least)
        assert bar.name == "known good: not measured"
        assert np.isnan(bar.value)
    assert rate("known good", [], 98.0).holds is False
    assert rate("known good", [True], 98.0).holds is True


def test_how_far_a_fault_moves_the_body_that_it_moves_most(robot: Robot):
    clip = standing(robot)
    moved = dataclasses.replace(clip, root_pos_w=clip.root_pos_w + np.array([0.03, 0.04, 0.0]))
    assert displacement(clip, moved, robot) == pytest.approx(0.05)
    assert matters("teleport", clip, moved, robot)
    turned = clip.joint_pos.copy()
    turned[:, robot.joint("AAHead_yaw")] += 1.0
    assert not matters("joint past its limit", clip, dataclasses.replace(clip, joint_pos=turned), robot)


ON_THE_SPOT = sorted(set(FAULTS) - {"double speed", SWAPPED, LABELS})
"""Those that are faults of a robot that stands too."""


@pytest.mark.parametrize("name", ON_THE_SPOT)
def test_what_is_planted_into_a_robot_that_stands_matters_and_is_found(root: Path, robot: Robot, name: str):
    limits = settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
    clip, rng = standing(robot, 4.0), np.random.default_rng(3)
    planted = FAULTS[name].plant(clip, robot, rng)
    assert matters(name, clip, planted, robot)
    assert assess(motion_of(clip, robot, limits), limits).holds
    broken = {verdict.code for verdict in assess(motion_of(planted, robot, limits), limits).broken}
    own = set(groups()[FAULTS[name].group])
    assert broken & own, broken


def test_seeds_draw_other_commands_inside_the_ranges():
    first, second = drawn_commands(40, 1), drawn_commands(40, 2)
    assert not set(first) & set(second)
    assert drawn_commands(40, 2) == second
    for forward, lateral, yaw in (*second, *commands_on_axes()):
        assert -0.6 - 1e-9 <= forward <= 2.0 + 1e-9
        assert abs(lateral) <= 0.6
        assert abs(yaw) <= 1.5


def test_a_robot_that_stands_is_told_from_one_that_walks_or_turns(robot: Robot):
    clip = standing(robot)
    times_s = np.arange(clip.frame_count)[:, None] / clip.fps
    assert stands(clip)
    assert not stands(dataclasses.replace(clip, root_pos_w=clip.root_pos_w + times_s * [0.2, 0.0, 0.0]))
    assert not stands(dataclasses.replace(clip, root_quat_w=rotation.about_z(0.5 * times_s[:, 0])))


def test_a_policy_is_named_by_its_file_or_its_folder(tmp_path: Path):
    assert policy_file(tmp_path) is None
    (tmp_path / "policy.npz").touch()
    assert policy_file(tmp_path) == policy_file(tmp_path / "policy.npz") == tmp_path / "policy.npz"
    (tmp_path / "t1_walk.npz").touch()
    assert policy_file(tmp_path) == tmp_path / "t1_walk.npz"


def test_the_shipped_policy_walks_and_what_is_planted_into_it_is_found(root: Path):
    limits = settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
    file = policy_file(root / "robots" / "t1" / "policies" / "walk")
    assert file is not None
    found = judge(file, (1.2, 0.0, 0.0), (1, 1), limits)
    assert not found.fell
    assert found.labelled == (True, 1.0)
    assert found.unlabelled
    assert found.told
    assert np.all(found.windows)
    assert found.broken == set()
    assert "double speed" not in found.found  # 1.2 m/s can be walked at twice the speed
    planted = {"joint past its limit", "teleport", "feet swapped", "floor 5 cm high", "floor 5 cm low"}
    for fault in planted:
        assert found.found[fault], fault
        assert found.found[f"{fault}, no labels"], fault
        assert found.found[f"{fault}, KP2's labels"], fault


@pytest.mark.parametrize(
    ("seeds", "axes", "drawn", "failing"),
    [
        (("94",), 0, 2, {"seed 94"}),  # 78 of 80, which with the axes would be 102 of 104
        (("94",), 1, 1, {"on the axes"}),
        (("7", "8"), 0, 1, set()),
        (("7", "8"), 0, 2, {"seed 7", "seed 8", "seeds 7 8 together"}),
    ],
)
def test_every_table_of_rollouts_has_the_bars_and_the_axes_lend_nothing_to_the_draws(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    root: Path,
    seeds: tuple[str, ...],
    axes: int,
    drawn: int,
    failing: set[str],
):
    """So many of the first on the axes, and of each seed, are refused."""

    def refused(policy: Path, command: tuple, seed: tuple, *_: object) -> Judged:
        good = seed[1] >= (drawn if seed[0] else axes)
        return Judged(labelled=(good, float(good)), unlabelled=True, told=True, windows=[True])

    monkeypatch.setattr(benchmark, "judge", refused)
    monkeypatch.setattr(benchmark, "tracking_bars", lambda *_: [])
    monkeypatch.setattr(benchmark, "likeness_bars", lambda *_: [])
    policy = str(root / "robots" / "t1" / "policies" / "walk")
    monkeypatch.setattr("sys.argv", ["feasibility.py", policy, "--seeds", *seeds, "--only", "--jobs", "1"])
    assert benchmark.main() == bool(failing)
    tables = {table.strip().partition("\n")[0]: table for table in capsys.readouterr().out.split("\n\n")}
    rollouts = {title.partition(", ")[2]: table for title, table in tables.items() if "known good" in table}
    several = {f"seeds {' '.join(seeds)} together"} if len(seeds) > 1 else set()
    assert set(rollouts) == {"on the axes", *(f"seed {seed}" for seed in seeds)} | several
    assert f"accepted whole ({24 - axes} of 24)" in rollouts["on the axes"]
    for title in several:
        assert f"accepted whole ({len(seeds) * (80 - drawn)} of {len(seeds) * 80})" in rollouts[title]
    assert all("holds" in table for table in rollouts.values())
    assert {title for title, table in rollouts.items() if "FAILS" in table} == failing
