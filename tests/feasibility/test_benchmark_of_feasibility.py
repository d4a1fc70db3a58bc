"""The benchmark of feasibility: falls are told, rates are of what walked, a fault is found by what is new."""

import dataclasses
from pathlib import Path

import numpy as np

from benchmarks.feasibility import fault_bars, known_good_bars
from benchmarks.feasibility_judge import Judged, commands_on_axes, drawn_commands, judge, policy_file, stands
from pipeline import rotation
from pipeline.feasibility import FeasibilitySettings
from pipeline.files import settings
from pipeline.robot import Robot
from tests.factories.robot_clips import standing


def test_rollouts_that_fell_are_told_and_not_counted_as_known_good():
    good, cut = Judged(labelled=(True, 1.0)), Judged(labelled=(False, 0.5), broken={"foot_slip_p95"})
    bars = {bar.name: bar for bar in known_good_bars([good, cut, Judged(fell=True)], ["foot_slip_p95"])}
    assert bars["known-good rollouts"].value == 2
    assert bars["rollouts that fell, left out"].value == 1
    assert bars["known good: accepted whole"].value == 50.0
    assert bars["known good: accepted whole, contacts not labelled"].value == 0.0
    assert bars["known good: seconds accepted"].value == 75.0
    assert bars["known good: hold foot_slip_p95, labelled or not"].value == 50.0


def test_a_fault_that_no_criterion_tells_is_a_miss():
    told, missed = Judged(found={"teleport": {"root_speed"}}), Judged(found={"teleport": set()})
    bars = {bar.name: bar for bar in fault_bars([told, told, told, missed])}
    assert bars["found: teleport (4 planted)"].value == 75.0
    assert bars["found: teleport (4 planted)"].holds is False
    assert bars["    by root_speed"].value == 75.0


def test_seeds_draw_other_commands_inside_the_ranges():
    first, second = drawn_commands(40, 1), drawn_commands(40, 2)
    assert not set(first) & set(second)
    assert drawn_commands(40, 2) == second
    for forward, lateral, yaw in (*second, *commands_on_axes()):
        assert -0.6 - 1e-9 <= forward <= 2.0 + 1e-9
        assert abs(lateral) <= 0.6
        assert abs(yaw) <= 1.5


def test_a_robot_that_stands_is_told_from_one_that_walks_or_turns(root: Path, robot: Robot):
    limits = settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
    clip = standing(robot)
    times_s = np.arange(clip.frame_count)[:, None] / clip.fps
    assert stands(clip, limits)
    assert not stands(dataclasses.replace(clip, root_pos_w=clip.root_pos_w + times_s * [0.2, 0.0, 0.0]), limits)
    assert not stands(dataclasses.replace(clip, root_quat_w=rotation.about_z(0.5 * times_s[:, 0])), limits)


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
    found = judge(file, (0.8, 0.0, 0.0), (1, 1), limits)
    assert not found.fell
    assert found.labelled == (True, 1.0)
    assert found.unlabelled
    assert np.all(found.windows)
    assert found.broken == set()
    assert "double speed" not in found.found  # half of .8 m/s can be walked at twice the speed
    planted = {"joint past its limit", "teleport", "feet swapped", "floor 5 cm high", "floor 5 cm low"}
    for fault in planted:
        assert found.found[fault], fault
        assert found.found[f"{fault}, no labels"], fault
