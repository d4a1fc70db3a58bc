"""The comparison of engines: its grid, its verdict on made-up figures, and the published policy in both."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from pipeline import rotation
from pipeline.cli import policy_commands
from pipeline.cli.main import main
from pipeline.deployment import save_policy
from pipeline.validation import cross_engine as comparison
from pipeline.validation.bars import Bar, CellBars, ValidationSettings
from pipeline.validation.cross_engine import cross_engine
from pipeline.validation.cross_engine_walk import (
    DART,
    MUJOCO,
    Cell,
    CrossEngineSettings,
    Figures,
    Segment,
    command_of,
    start_state,
    walk,
)
from pipeline.validation.deployed import Deployed
from pipeline.viewing.validation_plots import cross_engine_plots


def walked(**changes: float | None) -> Figures:
    numbers = {"fell_s": None, "forward_m_s": 0.5, "lateral_m_s": 0.0, "yaw_rate_rad_s": 0.0, "height_m": 0.67}
    return Figures(**{**numbers, "power_w": 100.0, **changes})  # pyright: ignore[reportArgumentType]


def fell(after_s: float) -> Figures:
    nan = float("nan")
    return walked(fell_s=after_s, forward_m_s=nan, lateral_m_s=nan, yaw_rate_rad_s=nan, height_m=nan)


A_CELL = Cell(segments=(Segment(seconds=1.0, command=(0.5, 0.0, 0.0)),), measured_s=0.5)


def asked(required: bool = True, **at_most: float) -> CellBars:
    """Bars of a cell by figure."""
    bars = {name: Bar(unit="unit", source="test", at_most=value) for name, value in at_most.items()}
    return CellBars(required=required, why="" if required else "the reference falls", bars=bars)


def judged(
    monkeypatch: pytest.MonkeyPatch,
    still: Deployed,
    settings: CrossEngineSettings,
    rules: ValidationSettings,
    bars: CellBars,
    **by_engine: Figures | list[Figures],
):
    """The verdict where engines would find these figures, one a seed."""
    rows = {engine: each if isinstance(each, list) else [each] for engine, each in by_engine.items()}
    monkeypatch.setattr(comparison, "walk_cell", lambda deployed, engine, cell, seed, simulation: rows[engine][seed])
    simulation = dataclasses.replace(settings.simulation, seeds=len(next(iter(rows.values()))))
    grid = dataclasses.replace(settings, simulation=simulation, cells={"walk": A_CELL})
    return cross_engine(still, grid, dataclasses.replace(rules, engines={"walk": bars}))


def test_the_grid_has_what_pure_forward_walking_misses(settings: CrossEngineSettings, rules: ValidationSettings):
    required = [cell for name, cell in settings.cells.items() if rules.engines[name].required]
    commands = np.array([segment.command for cell in required for segment in cell.segments])
    assert not commands[0].any()
    for axis in range(3):
        assert commands[:, axis].min() < 0.0 < commands[:, axis].max()
    assert any(abs(sum(s.seconds * s.command[2] for s in cell.segments)) > np.pi for cell in required)
    assert any(all(segment.slew == 0.0 for segment in cell.segments) for cell in required)
    assert {np.sign(cell.push.impulse).tobytes() for cell in required if cell.push} >= {
        np.sign(each).tobytes() for each in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    }


def test_each_cell_of_the_grid_has_bars_with_unit_and_source_or_says_why_not(
    settings: CrossEngineSettings, rules: ValidationSettings
):
    assert list(rules.engines) == list(settings.cells)
    for name, cell in rules.engines.items():
        assert cell.required == (not cell.why), name
        assert not cell.required or set(cell.bars) == {"falls", "speed_error", "yaw_rate_error"}, name
        assert all(bar.unit and "reference's worst" in bar.source for bar in cell.bars.values()), name
    assert sum(cell.required for cell in rules.engines.values()) >= 18
    assert all(each.unit and each.source for each in vars(rules.agreement).values())


def test_a_command_is_slewed_from_where_the_last_one_had_come_to():
    quick = Segment(seconds=0.5, command=(1.0, 0.0, 0.0))
    command = command_of([quick, Segment(seconds=1.0, command=(0.0, 0.0, -1.0), slew=2.0)])
    np.testing.assert_allclose(command(0.0), [0.0, 0.0, 0.0])
    np.testing.assert_allclose(command(0.3), [0.3, 0.0, 0.0])
    np.testing.assert_allclose(command(0.6), [0.3, 0.0, -0.2])
    np.testing.assert_allclose(command(9.0), [0.0, 0.0, -1.0])
    step = command_of([Segment(seconds=1.0, command=(0.6, 0.0, 0.0), slew=0.0)])
    np.testing.assert_allclose(step(0.0), [0.6, 0.0, 0.0])


def test_seeds_start_near_the_default_pose_in_any_direction(still: Deployed, settings: CrossEngineSettings):
    first = start_state(still.robot, still.task, 0, settings.simulation)
    np.testing.assert_array_equal(first.joint_pos, still.robot.default_joint_pos)
    yaws = []
    for seed in range(1, 8):
        state = start_state(still.robot, still.task, seed, settings.simulation)
        assert np.abs(state.joint_pos - first.joint_pos).max() <= settings.simulation.start_joint_pos
        yaws.append(float(rotation.yaw_of(state.root_quat_w)))
    assert np.ptp(yaws) > 2.0


def test_engines_that_agree_pass(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    result = judged(
        monkeypatch, still, settings, rules, asked(), mujoco=walked(), bridge=walked(), dart=walked(forward_m_s=0.56)
    )
    assert result.passed and result.reasons == ()


def test_a_disagreement_names_both_figures_and_where_it_comes_from(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    result = judged(
        monkeypatch,
        still,
        settings,
        rules,
        asked(),
        mujoco=walked(),
        bridge=walked(forward_m_s=0.48),
        dart=walked(forward_m_s=0.40, height_m=0.685),
    )
    assert result.reasons == (
        "cell 'walk': forward velocity 0.500 m/s in MuJoCo and 0.400 in DART, 0.100 apart, allowed is 0.070 "
        "(-0.020 from the armature on the links, -0.080 from contact and solver)",
        "cell 'walk': root height 0.670 m in MuJoCo and 0.685 in DART, 0.015 apart, allowed is 0.010 "
        "(+0.000 from the armature on the links, +0.015 from contact and solver)",
    )


def test_a_difference_that_the_bridge_has_too_is_the_armatures_and_is_listed(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    """.09 m/s from the armature on the links, .01 from contact: the policy is not to blame."""
    engines = {"mujoco": walked(), "bridge": walked(forward_m_s=0.41), "dart": walked(forward_m_s=0.40)}
    result = judged(monkeypatch, still, settings, rules, asked(), **engines)
    assert result.passed
    (said,) = result.to_dict()["explained"]
    assert said.startswith("cell 'walk': forward velocity 0.500 m/s in MuJoCo and 0.400 in DART")
    simulation = dataclasses.replace(settings.simulation, seeds=1)
    alone = dataclasses.replace(settings, simulation=simulation, cells={"walk": A_CELL})
    bars = dataclasses.replace(rules, engines={"walk": asked()})
    assert not cross_engine(still, alone, bars, engines=(MUJOCO, DART)).passed  # without a bridge nothing is explained


def test_fast_walks_may_differ_by_their_share(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    fast = {"mujoco": walked(forward_m_s=1.5), "bridge": walked(forward_m_s=1.5)}
    assert judged(monkeypatch, still, settings, rules, asked(), **fast, dart=walked(forward_m_s=1.61)).passed
    assert not judged(monkeypatch, still, settings, rules, asked(), **fast, dart=walked(forward_m_s=1.63)).passed


def test_every_fall_is_a_reason_and_is_not_averaged(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    result = judged(
        monkeypatch,
        still,
        settings,
        rules,
        asked(),
        mujoco=[walked(), walked(forward_m_s=9.0)],
        bridge=[walked(), fell(0.3)],
        dart=[walked(), fell(0.7)],
    )
    assert result.reasons == ("cell 'walk' seed 1 in DART: fell after 0.70 s",)
    assert result.cells[0].survival(DART) == 0.5
    assert result.to_dict()["walks"]["walk"]["dart"][1]["forward_m_s"] is None


def test_a_walk_that_ignores_its_command_fails_where_engines_agree(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    cell = asked(speed_error=0.2, yaw_rate_error=0.1)
    lazy = walked(forward_m_s=0.0, yaw_rate_rad_s=0.2)
    result = judged(monkeypatch, still, settings, rules, cell, mujoco=lazy, bridge=lazy, dart=lazy)
    assert result.reasons[0] == (
        "cell 'walk' seed 0 in MuJoCo: walks 0.00, 0.00 m/s for 0.5, 0, off by 0.500, asked is at most 0.2 unit"
    )
    assert "turns 0.20 rad/s for 0, off by 0.200, asked is at most 0.1 unit" in result.reasons[1]
    assert len(result.reasons) == 4


def test_what_is_not_required_is_listed_and_fails_nothing(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    cell = asked(required=False)
    result = judged(monkeypatch, still, settings, rules, cell, mujoco=walked(), bridge=walked(), dart=fell(0.2))
    assert result.reasons == ()
    well = judged(monkeypatch, still, settings, rules, asked(), mujoco=walked(), bridge=walked(), dart=walked())
    assert dataclasses.replace(result, cells=(*result.cells, *well.cells)).passed
    said = ["the reference falls", "cell 'walk' seed 0 in DART: fell after 0.20 s"]
    assert result.to_dict()["not_required"] == {"walk": said}


def test_bars_of_another_robot_are_said(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    well = {"mujoco": walked(), "bridge": walked(), "dart": walked()}
    other = judged(monkeypatch, still, settings, rules, asked(), **well)
    said = other.to_dict()
    assert said["robot_digest"] == still.robot.digest != said["robot_of_bars"] == rules.reference.robot
    assert f"({rules.reference.robot[:12]}) than the evaluated one ({still.robot.digest[:12]})" in said["note"]
    assert other.passed
    own = dataclasses.replace(rules, reference=dataclasses.replace(rules.reference, robot=still.robot.digest))
    assert judged(monkeypatch, still, settings, own, asked(), **well).to_dict()["note"] is None


@pytest.mark.parametrize("damping", [(), ("--ankle-kd", "2")])
def test_the_command_says_whose_bars_they_are_and_with_which_gains_it_walked(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    root: Path,
    tmp_path: Path,
    still: Deployed,
    damping: tuple[str, ...],
):
    monkeypatch.chdir(root)
    monkeypatch.setattr(comparison, "walk_cell", lambda *_: walked(forward_m_s=0.0))
    monkeypatch.setattr(policy_commands, "robot_folder", lambda project, name: root / "robots" / name)
    save_policy(tmp_path / "still.npz", still.policy)
    out = tmp_path / "said.json"
    asked = ("--cells", "stand", "--seeds", "1", "--workers", "1", "--json", str(out), *damping)
    assert main(["cross-engine", str(tmp_path / "still.npz"), *asked]) == 0
    found = json.loads(out.read_text())
    assert f"  note  {found['note']}\n" in capsys.readouterr().out
    kd = dict(zip(still.task.joint_names, still.task.kd.tolist(), strict=True))
    assert found["gains"]["Left_Knee_Pitch"]["kd"] == kd["Left_Knee_Pitch"]
    assert found["gains"]["Left_Ankle_Pitch"]["kd"] == (2.0 if damping else kd["Left_Ankle_Pitch"])
    assert kd["Left_Ankle_Pitch"] != 2.0


def test_where_nothing_is_required_nothing_passes(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    well = {"mujoco": walked(), "bridge": walked(), "dart": walked()}
    assert not judged(monkeypatch, still, settings, rules, asked(required=False), **well).passed
    assert judged(monkeypatch, still, settings, rules, asked(), **well).passed


def test_a_bridge_that_falls_hides_no_disagreement_and_explains_none(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    engines = {"mujoco": walked(), "bridge": fell(0.4), "dart": walked(forward_m_s=0.40)}
    result = judged(monkeypatch, still, settings, rules, asked(), **engines)
    assert result.reasons == (
        "cell 'walk': forward velocity 0.500 m/s in MuJoCo and 0.400 in DART, 0.100 apart, allowed is 0.070",
    )
    assert result.cells[0].explained == ()


def test_the_picture_shows_falls(
    monkeypatch: pytest.MonkeyPatch, still: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    """A PNG, and another one where a robot fell."""
    stood = judged(monkeypatch, still, settings, rules, asked(), mujoco=walked(), bridge=walked(), dart=walked())
    fallen = judged(monkeypatch, still, settings, rules, asked(), mujoco=walked(), bridge=walked(), dart=fell(0.2))
    pictures = [cross_engine_plots(each) for each in (stood, fallen)]
    assert all(each.startswith(b"\x89PNG") for each in pictures)
    assert pictures[0] != pictures[1]


@pytest.mark.shared
def test_the_published_policy_passes_a_fast_subset(
    published: Deployed, settings: CrossEngineSettings, rules: ValidationSettings
):
    """Forwards and round a corner: all engines, and the velocities of the notes."""
    result = cross_engine(
        published,
        dataclasses.replace(settings, simulation=dataclasses.replace(settings.simulation, seeds=1)),
        rules,
        only=("walk_0.6", "arc_left"),
    )
    assert result.passed, result.reasons
    walk_cell = result.cells[0]
    assert walk_cell.mean(MUJOCO, "forward_m_s") == pytest.approx(0.504, abs=0.02)
    assert walk_cell.mean("bridge", "forward_m_s") == pytest.approx(0.495, abs=0.02)
    assert walk_cell.mean(DART, "forward_m_s") == pytest.approx(0.492, abs=0.02)


@pytest.mark.shared
def test_a_walk_in_dart_gives_the_same_bits_again(published: Deployed, settings: CrossEngineSettings):
    cell = Cell(segments=(Segment(seconds=1.5, command=(0.6, 0.0, 0.0)),), measured_s=1.0)
    one, two = (walk(published, DART, cell, 1, settings.simulation) for _ in range(2))
    np.testing.assert_array_equal(one.qpos, two.qpos)
    np.testing.assert_array_equal(one.torque, two.torque)
