"""Bars of walks in several engines: from the reference's worst walk, on made-up figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipeline.deployment import deployment_task, load_policy, save_policy
from pipeline.errors import FileError
from pipeline.files.settings import read
from pipeline.robot import Robot
from pipeline.simulation.torque_envelope import TorqueEnvelope
from pipeline.validation.bars import UNKNOWN, CellBars, RobotBars, ValidationSettings
from pipeline.validation.cross_engine import CellResult, CrossEngineResult
from pipeline.validation.cross_engine_walk import Cell, CrossEngineSettings, Figures, Segment, SimulationSettings
from pipeline.validation.deployed import Deployed, deployed
from pipeline.validation.derive import ENGINES, PARTS, derive, main
from pipeline.validation.derived_bars import engine_bars
from tests.factories.policies import still_policy

SIMULATION = SimulationSettings(timestep_s=0.005, friction=1.0, seeds=2, start_joint_pos=0.0, start_yaw=0.0)
CELL = Cell(segments=(Segment(seconds=1.0, command=(1.0, 0.0, 0.0)),), measured_s=0.5)
GRID = CrossEngineSettings(simulation=SIMULATION, cells={"walk": CELL})


def walked(forward: float, turning: float = 0.0, fell_s: float | None = None) -> Figures:
    return Figures(
        fell_s=fell_s, forward_m_s=forward, lateral_m_s=0.0, yaw_rate_rad_s=turning, height_m=0.67, power_w=1.0
    )


def bars_of(rules: ValidationSettings, **figures: tuple[Figures, ...]) -> CellBars:
    result = CellResult(name="walk", bars=UNKNOWN, figures=figures, reasons=())
    return engine_bars([CrossEngineResult(robot="t1", cells=(result,))], GRID, rules)["walk"]


def test_a_bar_is_the_worst_of_all_walks_of_both_engines_with_the_margin(rules: ValidationSettings):
    found = bars_of(
        rules,
        mujoco=(walked(0.95), walked(0.96, 0.03)),
        bridge=(walked(0.5), walked(0.5, 0.5)),  # explains, and is held to nothing
        dart=(walked(0.92), walked(0.90, -0.02)),
    )
    assert found.required and found.why == ""
    for name, worst in {"speed_error": 0.1, "yaw_rate_error": 0.03}.items():
        margin = rules.margins[name]
        assert found.bars[name].at_most == pytest.approx(worst * (1.0 + margin.share) + margin.absolute, abs=1e-4)
        assert "of 4 walks in MuJoCo and DART" in found.bars[name].source
    assert found.bars["falls"].at_most == 0.0


def test_where_the_reference_falls_misses_or_engines_part_it_says_so(rules: ValidationSettings):
    good = (walked(0.95), walked(0.95))
    fallen = bars_of(rules, mujoco=good, bridge=good, dart=(walked(0.95), walked(float("nan"), fell_s=0.4)))
    assert (fallen.required, fallen.why) == (False, "the reference falls in DART in 1 of 2")
    slow = (walked(0.6), walked(0.6))
    missed = bars_of(rules, mujoco=slow, bridge=slow, dart=slow)
    assert (missed.required, missed.why) == (False, "the reference misses the command by 0.40 m/s")
    apart = (walked(0.8), walked(0.8))
    parted = bars_of(rules, mujoco=good, bridge=good, dart=apart)
    assert not parted.required
    assert parted.why.startswith("forward velocity 0.950 m/s in MuJoCo and 0.800 in DART, 0.150 apart")
    assert bars_of(rules, mujoco=good, bridge=apart, dart=apart).required  # the armature on the links makes it
    once = (walked(0.95), walked(0.85))  # .05 apart on average, .10 with the second seed
    alone = bars_of(rules, mujoco=good, bridge=good, dart=once)
    assert alone.why.startswith("forward velocity 0.950 m/s in MuJoCo and 0.850 in DART, 0.100 apart")


def test_parts_of_another_reference_do_not_stay_beside_new_bars(
    tmp_path: Path, root: Path, robot: Robot, rules: ValidationSettings
):
    path = tmp_path / "validation.yaml"
    path.write_text((root / "robots/t1/validation.yaml").read_text())
    task = deployment_task(robot)
    envelope = TorqueEnvelope(limit=robot.torque_limit)
    other = Deployed(robot=robot, task=task, policy=still_policy(task), envelope=envelope)
    left = "its cells, webots, limit_cycles are of another policy or robot"
    with pytest.raises(FileError, match=f"{left}.*Derive all parts"):
        derive(path, other, {ENGINES: rules.engines}, "derive")
    derive(path, other, {**{part: {} for part in PARTS}, "cells": rules.cells}, "derive")
    now = read(path, RobotBars)
    assert now.reference.robot == robot.digest
    assert (now.cells, now.engines, now.webots, now.limit_cycles) == (rules.cells, {}, {}, {})


def test_the_command_derives_the_bars_between_engines(
    tmp_path: Path, root: Path, robot: Robot, rules: ValidationSettings, monkeypatch: pytest.MonkeyPatch
):
    """Of a policy that stands still where it should walk."""
    monkeypatch.chdir(tmp_path)
    grid = {"simulation": vars(SIMULATION), "cells": {"walk": {"segments": [{"seconds": 0.6, "command": [1, 0, 0]}]}}}
    grid["cells"]["walk"]["measured_s"] = 0.2
    path, data = tmp_path / "robots" / "t1" / "validation.yaml", tmp_path / "data"
    path.parent.mkdir(parents=True)
    data.mkdir()
    (data / "cross_engine.yaml").write_text(json.dumps(grid))
    (data / "validation.yaml").write_text((root / "data/validation.yaml").read_text())
    task = deployment_task(robot)
    save_policy(tmp_path / "still.npz", still_policy(task))
    one = deployed(root / "robots" / "t1", load_policy(tmp_path / "still.npz"))
    path.write_text((root / "robots/t1/validation.yaml").read_text())
    derive(path, one, {part: {} for part in PARTS}, "derive")
    arguments = ["still.npz", "--robot", str(root / "robots" / "t1"), "--workers", "1", "--parts", "engines"]
    assert main(arguments) == 0
    now = read(path, RobotBars)
    assert list(now.engines) == ["walk"]
    assert not now.engines["walk"].required
    assert "the reference misses the command by" in now.engines["walk"].why
    assert "of 4 walks in MuJoCo and DART" in now.engines["walk"].bars["speed_error"].source
    assert now.reference.command.startswith("python -m pipeline.validation.derive still.npz")
