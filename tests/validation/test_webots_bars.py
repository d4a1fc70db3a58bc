"""Bars of the walk in Webots: from the reference's walks in stand-ins, and what a project is held to by them."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.files.settings import read
from pipeline.validation.bars import Bar, CellBars, ValidationSettings
from pipeline.validation.derived_bars import allowed_of, webots_bars
from pipeline.validation.limit_cycle_walks import name_of
from pipeline.validation.limit_cycles import LimitCycleSettings
from pipeline.webots.result import WalkedSegment, WalkResult, WalkSegment, WebotsSettings

WALK = WebotsSettings(
    timestep_ms=5.0,
    friction=1.0,
    measured_s=1.0,
    limit_s=9.0,
    segments=(WalkSegment(name="walk", seconds=2.0, command=(1.0, 0.0, 0.0)),),
)


def walked(forward: float, turning: float = 0.0) -> WalkResult:
    row = WalkedSegment(
        name="walk", walked=True, forward_m_s=forward, lateral_m_s=0.0, yaw_rate_rad_s=turning, height_m=0.67
    )
    return WalkResult(run="a", timestep_ms=5.0, seconds=2.0, fell_s=None, policy=True, segments=(row,))


def fell() -> WalkResult:
    row = WalkedSegment(
        name="walk", walked=False, forward_m_s=None, lateral_m_s=None, yaw_rate_rad_s=None, height_m=None
    )
    return WalkResult(run="a", timestep_ms=5.0, seconds=2.0, fell_s=0.5, policy=True, segments=(row,))


def test_a_bar_is_the_worst_of_the_stand_ins_with_the_margin(rules: ValidationSettings):
    found = webots_bars({"mujoco": walked(0.95, 0.02), "ode": walked(0.9)}, WALK, rules)["walk"]
    assert found.required
    for name, worst in {"speed_error": 0.1, "yaw_rate_error": 0.02}.items():
        margin = rules.margins[name]
        assert found.bars[name].at_most == pytest.approx(worst * (1.0 + margin.share) + margin.absolute, abs=1e-4)
        assert "its walks in mujoco; ode" in found.bars[name].source


def test_what_the_reference_does_not_walk_is_not_required(rules: ValidationSettings):
    falls = webots_bars({"mujoco": walked(0.95), "ode": fell()}, WALK, rules)["walk"]
    assert (falls.required, falls.why) == (False, "the reference falls in ode")
    slow = webots_bars({"mujoco": walked(0.6)}, WALK, rules)["walk"]
    assert (slow.required, slow.why) == (False, "the reference misses the command by 0.40 m/s")
    assert allowed_of({"walk": falls}) == {}


def test_a_required_segment_without_a_bar_allows_nothing():
    cell = CellBars(required=True, why="", bars={"speed_error": Bar(unit="m/s", source="test", at_most=0.2)})
    allowed = allowed_of({"walk": cell})["walk"]
    assert (allowed.velocity_error_m_s, allowed.yaw_rate_error_rad_s) == (0.2, 0.0)


def test_the_shipped_bars_are_of_what_is_walked(root: Path, rules: ValidationSettings):
    walk = read(root / "data" / "webots.yaml", WebotsSettings)
    cycles = read(root / "data" / "limit_cycles.yaml", LimitCycleSettings)
    assert list(rules.webots) == [each.name for each in walk.segments]
    assert list(rules.limit_cycles) == [name_of(speed) for speed in cycles.speeds_m_s]
    for name, cell in {**rules.webots, **rules.limit_cycles}.items():
        assert cell.required == (not cell.why), name
        assert all(bar.unit and "reference's worst" in bar.source for bar in cell.bars.values()), name
    assert all(set(cell.bars) == {"speed_error", "yaw_rate_error"} for cell in rules.webots.values())
    assert rules.limit_cycles["0.6 m/s"].required
