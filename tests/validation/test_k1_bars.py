"""The K1's stated bars: those that are required of its policy, on a policy that only stands."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from pipeline.batch import ClipPool
from pipeline.deployment import digest, save_policy
from pipeline.files.settings import read
from pipeline.robot import Robot, load_robot
from pipeline.robot.load import ROBOTS
from pipeline.validation.bars import RobotBars, ValidationRules, ValidationSettings, read_validation, scaled_to
from pipeline.validation.cross_engine import CrossEngineResult, cross_engine
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.deployed import Deployed, deployed
from pipeline.validation.derive import main, text_of
from pipeline.validation.figures import measure
from pipeline.validation.suites import full, named
from pipeline.validation.verdict import judge
from tests.factories.standing_policy import standing_policy

WALKED = ("vx -0.3", "stand", "vx +0.3", "vx +0.6", "vx +1.0", "vx +1.5")


@pytest.fixture(scope="module")
def k1() -> Robot:
    return load_robot("k1")


@pytest.fixture(scope="module")
def bars(root: Path) -> ValidationSettings:
    return read_validation(root / "data/validation.yaml", root / "robots/k1/validation.yaml")


@pytest.fixture(scope="module")
def stands(k1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Deployed:
    return deployed(ROBOTS / "k1", standing_policy(k1))


def test_the_sweep_is_required_without_a_fall_and_within_8_cm_per_second(k1: Robot, bars: ValidationSettings):
    sweep = [cell for cell in full(k1) if cell.group == "commands"]
    assert len(sweep) == 16
    for cell in sweep:
        found = bars.cells[cell.name]
        assert found.required and found.bars["falls"].at_most == 0.0
        assert found.bars.keys() == {"falls", *(["speed_error"] if cell.name in WALKED else [])}
        assert cell.name not in WALKED or found.bars["speed_error"].at_most == 0.08


def test_pushes_of_20_newton_seconds_in_8_directions_are_withstood(k1: Robot, bars: ValidationSettings):
    for gait in ("standing", "walking"):
        name = f"push force {gait} 20 Ns"
        (cell,) = named(k1, {name: 64})
        assert len({tuple(each.events[0].force_w.round(6)) for each in cell.trials}) == 8
        assert bars.cells[name].bars["survival"].at_least == 0.95


def test_the_same_speeds_are_required_in_both_engines(root: Path, bars: ValidationSettings):
    grid = read(root / "data/cross_engine.yaml", CrossEngineSettings)
    speeds = {}
    for name, found in bars.engines.items():
        assert found.required and found.bars["falls"].at_most == 0.0
        if "speed_error" in found.bars:
            assert found.bars["speed_error"].at_most == 0.08
            speeds[name] = grid.cells[name].segments[-1].command[0]
    assert sorted(speeds.values()) == [-0.5, 0.0, 0.6, 1.0, 1.5]


def test_every_cell_of_the_bars_is_one_that_is_run(k1: Robot, root: Path, bars: ValidationSettings):
    assert bars.cells.keys() <= {cell.name for cell in full(k1)}
    assert bars.engines.keys() <= read(root / "data/cross_engine.yaml", CrossEngineSettings).cells.keys()


def test_a_standing_policy_passes_stand_alone(stands: Deployed, bars: ValidationSettings):
    cells = named(stands.robot, {"stand": 2, "vx +0.6": 1, "vx +2.0": 1, "push force standing 20 Ns": 8})
    measured = measure(stands, cells, ClipPool(workers=1))
    verdict = judge(measured, bars, suite="few", policy=digest(stands.policy), robot=stands.robot.digest)
    words = {cell.measured.cell.name: cell.word for cell in verdict.cells}
    assert (words["stand"], words["vx +0.6"], words["push force standing 20 Ns"]) == ("passed", "failed", "failed")
    assert "vx +0.6: speed error 0.6 m/s, asked is at most 0.08 m/s" in map(str, verdict.reasons)
    assert verdict.note == ""


def test_both_engines_agree_that_it_stands(stands: Deployed, root: Path, bars: ValidationSettings):
    grid = read(root / "data/cross_engine.yaml", CrossEngineSettings)
    few = dataclasses.replace(grid, simulation=dataclasses.replace(grid.simulation, seeds=2))
    found: CrossEngineResult = cross_engine(stands, few, bars, only=("stand", "walk_0.6"))
    words = {cell.name: cell.word for cell in found.cells}
    assert words == {"stand": "passed", "walk_0.6": "failed"}
    assert found.note == ""


def test_margins_and_tolerances_are_the_files_for_the_t1_and_scaled_for_the_k1(root: Path, k1: Robot):
    rules = read(root / "data/validation.yaml", ValidationRules)
    assert scaled_to(rules, load_robot("t1")) == rules
    found = scaled_to(rules, k1)
    legs, mass = k1.leg_length / 0.5516, k1.total_mass / 31.734
    assert found.agreement.height.at_most == pytest.approx(0.01 * legs)
    assert found.agreement.velocity.at_most == pytest.approx(0.07 * legs**0.5)
    assert found.agreement.yaw_rate.at_most == pytest.approx(0.06 * legs**-0.5)
    assert found.margins["power"].absolute == pytest.approx(20.0 * mass * legs**0.5, rel=1e-3)
    assert found.margins["survival"] == rules.margins["survival"]
    again = scaled_to(found, k1)
    assert again.margins["power"].absolute == pytest.approx(found.margins["power"].absolute)


def test_stated_bars_give_way_to_derived_ones(tmp_path: Path, root: Path, k1: Robot, monkeypatch):
    """The first policy that walks is measured with its own gains, and again when the bars are derived once more."""
    monkeypatch.chdir(tmp_path)
    data = tmp_path / "data"
    data.mkdir()
    cell = {"segments": [{"seconds": 1.0, "command": [0, 0, 0]}], "measured_s": 0.2}
    simulation = {"timestep_s": 0.005, "friction": 1.0, "seeds": 1, "start_joint_pos": 0.0, "start_yaw": 0.0}
    (data / "cross_engine.yaml").write_text(json.dumps({"simulation": simulation, "cells": {"stand": cell}}))
    (data / "validation.yaml").write_text((root / "data/validation.yaml").read_text())
    file = tmp_path / "bars.yaml"
    bars = read(root / "robots/k1/validation.yaml", RobotBars)
    empty = dataclasses.replace(bars, cells={}, engines={})
    policy = standing_policy(k1)
    save_policy(tmp_path / "stands.npz", policy)
    given = ["stands.npz", "--robot", str(root / "robots/k1"), "--file", str(file), "--workers", "1"]
    for _ in range(2):
        assert main([*given, "--parts", "engines"]) == 0
        found = read(file, RobotBars)
        assert found.reference.policy == digest(policy)
        assert found.engines["stand"].required, found.engines["stand"].why
    file.write_text(text_of(empty))
    assert main([*given, "--parts", "engines"]) == 1  # the stated parts would stay beside the derived one
