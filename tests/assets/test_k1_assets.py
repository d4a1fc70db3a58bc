"""The K1 in the graph with a policy put in place: export, validation in MuJoCo and DART, and its logs to a proposal."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import dagster as dg
import numpy as np
import pytest
import yaml

from assets import failure_modes, feedback, limit_cycles, policy, resources, validation
from assets.plan import robot_plans
from assets.resources import ClipPoolResource, StoreIOManager
from pipeline.batch import Manifest
from pipeline.deployment import digest, load_policy, save_policy
from pipeline.export.folder import Source, export_policy
from pipeline.failures.trial_report import TrialReport
from pipeline.project import Project
from pipeline.robot import Robot, load_robot
from pipeline.validation import suites
from pipeline.virtual_robot.scripted import SWAY, TOPPLE_LEFT
from pipeline.virtual_robot.trial import VirtualTrial
from tests.factories.log_trials import scripted_log, trial_of, write_trial
from tests.factories.standing_policy import standing_policy

PLANS = robot_plans("k1")
EXPORTED, TRAINED, ADAPTED = (PLANS[name] for name in ("exported_policy", "amp_policy", "adapted_robot"))
FEW = {"stand": 1, "vx +0.6": 1}
FREE = {"strictest": "public-domain", "allowed_use": "Any use."}


@pytest.fixture(scope="module")
def k1() -> Robot:
    return load_robot("k1")


@pytest.fixture
def project(tmp_path: Path, root: Path, k1: Robot, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project whose K1 ships a policy that stands; validations are short."""
    project = Project(tmp_path)
    for name in ("k1", "t1"):
        shutil.copytree(root / "robots" / name, tmp_path / "robots" / name, ignore=shutil.ignore_patterns("policies"))
    shutil.copytree(tmp_path / "robots" / "k1", project.adapted_robot("k1"))
    for path in (root / "data").glob("*.yaml"):
        shutil.copy(path, project.data)
    grid = yaml.safe_load((root / "data" / "cross_engine.yaml").read_text())
    grid["simulation"]["seeds"] = 1
    grid["cells"] = {name: grid["cells"][name] for name in ("stand", "walk_0.6", "left_0.6")}
    (project.data / "cross_engine.yaml").write_text(json.dumps(grid))
    for module in (failure_modes, feedback, limit_cycles, policy, resources, validation):
        monkeypatch.setattr(module, "PROJECT", project)
    monkeypatch.setattr(validation, "cells_of", lambda suite, robot: suites.named(robot, FEW))
    monkeypatch.setattr(validation, "SHOWN", {"stand": 1})
    save_policy(tmp_path / "stands.npz", standing_policy(k1))
    source = Source(
        policy=tmp_path / "stands.npz", run={"name": "none: it stands"}, data={"digest": "d", "licence": FREE}
    )
    folder = project.shipped_policies("k1") / "walk"
    export_policy(folder, "stands", k1, source, np.random.default_rng(0), shippable=True, compact=True)
    return project


def test_a_policy_put_in_place_is_exported_and_validated_in_both_engines(project: Project, k1: Robot):
    named = PLANS["mujoco_validation"]
    result = dg.materialize(
        [
            policy.exported_policy(EXPORTED),
            dg.AssetSpec(ADAPTED.key),
            dg.AssetSpec(TRAINED.key),
            dg.AssetSpec(PLANS["robot_model"].key),
            validation.mujoco_validation(named),
            validation.cross_engine_validation(PLANS["cross_engine_validation"]),
        ],
        resources={
            "clip_pool": ClipPoolResource(workers=1),
            "io_manager": StoreIOManager(bootstrap=False),
        },
    )
    assert result.success
    assert load_policy(project.exported_policy("k1") / "policy.npz").gains is not None
    assert "K1_CFG" in "".join(path.read_text() for path in project.exported_policy("k1").rglob("*.py"))
    policy_digest = digest(standing_policy(k1))
    verdicts = {
        name: project.store.load(plan.key.to_user_string()).settings["verdict"]
        for name, plan in (("mujoco", named), ("engines", PLANS["cross_engine_validation"]))
    }
    assert [each["policy"] for each in verdicts.values()] == [policy_digest, policy_digest]
    assert [each["passed"] for each in verdicts.values()] == [False, False]
    assert verdicts["mujoco"]["reasons"] == ["vx +0.6: speed error 0.6 m/s, asked is at most 0.08 m/s"]
    assert all("walk_0.6" in reason for reason in verdicts["engines"]["reasons"])
    assert list(verdicts["engines"]["not_required"]) == ["left_0.6"]
    assert all(each["note"] is None for each in verdicts.values())
    logs = {path.name for path in project.simulated_failures("k1", "mujoco").glob("*.mcap")}
    assert logs == {"vx_plus_0.6.mcap"}


def test_a_robot_without_required_speeds_says_that_nothing_was_shown(project: Project):
    cycles = yaml.safe_load((project.data / "limit_cycles.yaml").read_text())
    (project.data / "limit_cycles.yaml").write_text(json.dumps(cycles | {"seconds": 2.0, "settled_s": 0.5}))

    @dg.asset(key=EXPORTED.key)
    def exported_policy() -> Manifest:
        return Manifest(stage="exported_policy", entries=(), judged=(), settings={"p": {"digest": "d", "files": {}}})

    config = {"ops": {"k1__limit_cycles": {"config": {"policy": str(project.root / "stands.npz")}}}}
    result = dg.materialize(
        [
            exported_policy,
            dg.AssetSpec(ADAPTED.key),
            limit_cycles.limit_cycles(PLANS["limit_cycles"]),
        ],
        resources={"io_manager": dg.mem_io_manager},
        run_config=config,
    )
    (check,) = result.get_asset_check_evaluations()
    assert (check.passed, check.metadata["found"].value) == (False, limit_cycles.NONE_REQUIRED)
    verdict = result.output_for_node("k1__limit_cycles").settings[limit_cycles.VERDICT]
    assert (verdict["passed"], verdict["reasons"]) == (False, [limit_cycles.NONE_REQUIRED])


def test_falls_of_a_k1_in_22_motor_logs_become_a_proposal_for_it_alone(project: Project, k1: Robot, tmp_path: Path):
    """Two logs of a fall to the left at a lateral command, and one of standing, as the reader makes trials of them."""
    for name in ("t1", "k1"):
        calibration = robot_plans(name)["actuator_calibration"].key.to_user_string()
        project.store.save(calibration, Manifest(stage="actuator_calibration", entries=(), judged=()))
    asked = VirtualTrial(command=((0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.4, 0.0)), seconds=5.0)
    answers = {}
    for number, script in enumerate((TOPPLE_LEFT, TOPPLE_LEFT, SWAY)):
        name = f"k1_{number}"
        trial = trial_of(scripted_log(k1, script, asked, seed=number), k1, name)
        assert trial.joint_pos.shape[1] == 22
        write_trial(tmp_path / f"{name}.parquet", trial)
        numbers = {"robot": "k1", "policy_digest": trial.policy_digest, "log": name}
        answers[name] = failure_modes._findings(name, tmp_path / f"{name}.parquet", numbers)
        assert "unread" not in answers[name], answers[name]
    reports = {name: TrialReport.from_dict(each["report"]) for name, each in answers.items()}
    falls = {name: sum(each.kind == "fall" for each in report.failures) for name, report in reports.items()}
    assert falls == {"k1_0": 1, "k1_1": 1, "k1_2": 0}
    manifest = Manifest(
        stage="failure_modes", entries=(), judged=(), settings={n: {"report": a["report"]} for n, a in answers.items()}
    )
    result = feedback.curation_feedback(dg.build_asset_context(), failure_modes=manifest)
    assert isinstance(result, dg.MaterializeResult) and result.metadata is not None
    text = json.dumps(yaml.safe_load(project.proposed_feedback.read_text()))
    assert '"k1"' in text and '"t1"' not in text
    assert result.metadata["changes pending"] == 4
