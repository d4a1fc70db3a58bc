"""Verdicts of other engines in the graph: bars from the one file, reasons, logs of what failed."""

import html
import json
import shutil
from pathlib import Path

import dagster as dg
import pytest
import yaml

from assets import limit_cycles, policy, validation
from assets.plan import robot_plans
from assets.resources import ClipPoolResource
from pipeline.batch import Manifest
from pipeline.deployment import deployment_task, digest
from pipeline.project import Project
from pipeline.robot import Robot
from tests.factories.policies import still_policy

PLANS = robot_plans("t1")
EXPORTED, ADAPTED = PLANS["exported_policy"], PLANS["adapted_robot"]
WALK = {"segments": [{"seconds": 1.0, "command": [0.6, 0, 0]}], "measured_s": 0.5}


@pytest.fixture
def project(tmp_path: Path, root: Path, robot: Robot, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project whose grid and limit cycles are short, with a policy that does not walk."""
    project = Project(tmp_path)
    shutil.copytree(root / "robots" / "t1", project.adapted_robot("t1"), ignore=shutil.ignore_patterns("policies"))
    shutil.copytree(project.adapted_robot("t1"), project.robot_folder("t1"))
    shutil.copy(root / "data" / "validation.yaml", tmp_path / "data" / "validation.yaml")
    grid = yaml.safe_load((root / "data" / "cross_engine.yaml").read_text())
    grid["simulation"]["seeds"] = 1
    grid["cells"] = {"walk_0.6": WALK, "walk_2.0": WALK}
    (tmp_path / "data" / "cross_engine.yaml").write_text(json.dumps(grid))
    cycles = yaml.safe_load((root / "data" / "limit_cycles.yaml").read_text())
    cycles |= {"seconds": 3.0, "settled_s": 0.5}
    (tmp_path / "data" / "limit_cycles.yaml").write_text(json.dumps(cycles))
    for module in (policy, validation, limit_cycles):
        monkeypatch.setattr(module, "PROJECT", project)
    still = still_policy(deployment_task(robot))
    monkeypatch.setattr(policy, "stored_policy", lambda manifest: still)
    return project


def ran(asset: dg.AssetsDefinition, *more: dg.AssetsDefinition) -> dg.ExecuteInProcessResult:
    @dg.asset(key=EXPORTED.key)
    def exported_policy() -> Manifest:
        facts = {"digest": "another", "files": {"policy.npz": "f"}}
        return Manifest(stage="exported_policy", entries=(), judged=(), settings={"policy": facts})

    resources = {"clip_pool": ClipPoolResource(workers=1), "io_manager": dg.mem_io_manager}
    return dg.materialize([exported_policy, dg.AssetSpec(ADAPTED.key), asset, *more], resources=resources)


def test_cross_engine_tells_reasons_and_why_a_cell_is_not_required_and_writes_what_failed(
    project: Project, robot: Robot
):
    old = project.simulated_failures("t1", "cross_engine") / "of_an_earlier_verdict.mcap"
    old.parent.mkdir(parents=True)
    old.write_bytes(b"old")
    plan = PLANS["cross_engine_validation"]
    result = ran(validation.cross_engine_validation(plan))
    said = result.output_for_node("cross_engine_validation").settings[policy.VERDICT]
    assert (said["passed"], said["policy"]) == (False, digest(still_policy(deployment_task(robot))))
    assert any("asked is at most 0.1" in reason or "fell after" in reason for reason in said["reasons"])
    assert said["robot_digest"] == robot.digest != said["robot_of_bars"]
    assert list(said["not_required"]) == ["walk_2.0"]
    assert "MuJoCo and 2.0" in said["not_required"]["walk_2.0"][0]
    assert "reference's worst" in said["bars"]["walk_0.6"]["bars"]["speed_error"]["source"]
    assert sorted(path.name for path in old.parent.glob("*.mcap")) == ["walk_0.6_dart.mcap", "walk_0.6_mujoco.mcap"]
    (event,) = result.asset_materializations_for_node("cross_engine_validation")
    assert "walk_2.0: forward velocity" in html.unescape(str(event.metadata["not required"].value))
    (check,) = result.get_asset_check_evaluations()
    assert event.metadata["note"].value == check.metadata["note"].value == said["note"]
    assert "were derived on another robot" in said["note"]


def test_limit_cycles_hold_the_required_speed_to_the_bars_of_the_file(project: Project):
    result = ran(limit_cycles.limit_cycles(PLANS["limit_cycles"]))
    said = result.output_for_node("limit_cycles").settings[limit_cycles.VERDICT]
    assert said["passed"] is False
    assert said["reasons"]
    assert [each["required"] for each in said["speeds"]] == [True, False]
    assert "were derived on another robot" in said["note"]
    assert "2 m/s: the reference's period differs by 19 % between MuJoCo and DART" in said["not required"]
