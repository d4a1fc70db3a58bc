"""`mujoco_validation` in the graph: verdict, pictures and the logs of what failed."""

import shutil
from pathlib import Path

import dagster as dg
import pytest

from assets import policy, validation
from assets.plan import robot_plans
from assets.resources import ClipPoolResource
from pipeline.batch import Manifest
from pipeline.deployment import deployment_task, digest
from pipeline.project import Project
from pipeline.robot import Robot
from pipeline.validation import suites
from tests.factories.policies import still_policy

FEW = {"push force standing 20 Ns": 1, "push force standing 60 Ns": 1}
PLANS = robot_plans("t1")
EXPORTED, ADAPTED = PLANS["exported_policy"], PLANS["adapted_robot"]


@pytest.fixture
def project(tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project with a robot whose policy holds the default pose, which pushes topple."""
    project = Project(tmp_path)
    shutil.copytree(root / "robots" / "t1", tmp_path / "robots" / "t1", ignore=shutil.ignore_patterns("policies"))
    shutil.copytree(tmp_path / "robots" / "t1", project.adapted_robot("t1"))
    shutil.copy(root / "data" / "validation.yaml", tmp_path / "data" / "validation.yaml")
    for module in (policy, validation):
        monkeypatch.setattr(module, "PROJECT", project)
    monkeypatch.setattr(validation, "cells_of", lambda suite, robot: suites.named(robot, FEW))
    monkeypatch.setattr(validation, "SHOWN", {"push force standing 20 Ns": 1})
    return project


def test_a_policy_that_falls_is_failed_with_reasons_pictures_and_logs(
    project: Project, robot: Robot, monkeypatch: pytest.MonkeyPatch
):
    still = still_policy(deployment_task(robot))
    monkeypatch.setattr(policy, "stored_policy", lambda manifest: still)

    passed_now = project.simulated_failures("t1", "mujoco") / "of_an_earlier_verdict.mcap"
    passed_now.parent.mkdir(parents=True)
    passed_now.write_bytes(b"old")

    @dg.asset(key=EXPORTED.key)
    def exported_policy() -> Manifest:
        facts = {"digest": "of what lay there when it was exported"}
        return Manifest(stage="exported_policy", entries=(), judged=(), settings={"p": facts})

    ran = dg.materialize(
        [
            exported_policy,
            dg.AssetSpec(ADAPTED.key),
            validation.mujoco_validation(PLANS["mujoco_validation"]),
        ],
        resources={"clip_pool": ClipPoolResource(workers=1), "io_manager": dg.mem_io_manager},
    )
    said = ran.output_for_node("mujoco_validation").settings[validation.VERDICT]
    assert said["passed"] is False
    assert said["policy"] == digest(still)  # of what walked
    assert any(reason.startswith("push force standing 20 Ns: survival 0") for reason in said["reasons"])
    assert said["robot"] != said["robot_of_bars"]  # here it is the plain one
    assert "were derived on another robot" in said["note"]
    logs = sorted(project.simulated_failures("t1", "mujoco").glob("*.mcap"))
    assert [path.name for path in logs] == ["push_force_standing_20_ns.mcap"]  # 60 N s is not required
    (event,) = ran.asset_materializations_for_node("mujoco_validation")
    pictures = ("command tracking", "survival of pushes", "torque over speed", "foot contacts")
    assert all("data:image/png" in str(event.metadata[name].value) for name in pictures)
    (check,) = ran.get_asset_check_evaluations()
    assert (check.check_name, check.passed) == (validation.PASSED, False)
    assert event.metadata["note"].value == check.metadata["note"].value == said["note"]


def test_other_engines_say_the_digest_of_what_they_walk_too(
    project: Project, robot: Robot, monkeypatch: pytest.MonkeyPatch
):
    still = still_policy(deployment_task(robot))
    monkeypatch.setattr(policy, "PROJECT", project)
    monkeypatch.setattr(policy, "stored_policy", lambda manifest: still)
    exported = Manifest(stage="exported_policy", entries=(), judged=(), settings={"p": {"digest": "another"}})
    found, _ = policy.evaluated_policy(policy.EvaluatedPolicyConfig(), exported, "t1")
    assert digest(found.policy) == digest(still)


def test_a_quick_verdict_leaves_the_logs_of_cells_that_it_did_not_try(tmp_path: Path):
    paths = [tmp_path / f"{name}.mcap" for name in ("failed_now", "passes_now", "not_tried")]
    for path in paths:
        path.write_bytes(b"log")
    policy.remove_earlier_logs(tmp_path, paths[:1], {*paths[:2]})
    assert sorted(tmp_path.iterdir()) == [paths[0], paths[2]]
    policy.remove_earlier_logs(tmp_path, paths[:1])
    assert sorted(tmp_path.iterdir()) == paths[:1]
