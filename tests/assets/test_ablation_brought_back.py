"""The ablation of runs that were trained elsewhere: measured here, recorded, and served so."""

import json
import shutil
from typing import Any

import dagster as dg
import pytest

from assets import ablation, policy, resources
from assets.plan import robot_plans
from assets.project import PROJECT, Project
from assets.resources import ClipPoolResource, StoreIOManager
from tests.factories.ablation_runs import CURVES, change_config, write_arm_runs

PLANS = robot_plans("t1")
ABLATION, DATABASE, ADAPTED = (PLANS[name] for name in ("augmentation_ablation", "expert_db", "adapted_robot"))
COMMIT = "0123abc"


@pytest.fixture
def project(tmp_path, root, monkeypatch):
    """A project with a robot and a bundle, whose policies are measured by their file's text."""
    project = Project(tmp_path / "project")
    ignored = shutil.ignore_patterns("policies")
    shutil.copytree(root / "robots" / "t1", project.robot_folder("t1"), ignore=ignored)
    for module in (policy, ablation, resources):
        monkeypatch.setattr(module, "PROJECT", project)
    about = {"robot": "t1", "robot_digest": "r1", "database_digest": "d1", "augmented_by": ["mirror", "time-scale"]}
    bundle = project.policies("t1") / "bundle"
    bundle.mkdir(parents=True)
    (bundle / "bundle.json").write_text(json.dumps(about))
    monkeypatch.setattr(ablation, "bundle_of", lambda *_: (bundle, about))
    monkeypatch.setattr(ablation, "figures_of", lambda path, *_: {f"error of {path.read_text()}": 0.25})
    monkeypatch.setattr(ablation, "train_arms", lambda *_: pytest.fail("a training was started"))
    monkeypatch.setattr(ablation, "gpus_here", lambda: 0)
    return project


@pytest.fixture
def runs(project, tmp_path):
    return write_arm_runs(tmp_path / "runs", project.policies("t1") / "bundle", seeds=(1, 2), discriminator__style=0.4)


def ablate(**config: Any) -> dg.ExecuteInProcessResult:
    return dg.materialize(
        [ablation.augmentation_ablation(ABLATION, DATABASE, ADAPTED)],
        resources={"io_manager": StoreIOManager(bootstrap=False), "clip_pool": ClipPoolResource(workers=1)},
        run_config={"ops": {"augmentation_ablation": {"config": config}}},
        raise_on_error=False,
    )


def told(result: dg.ExecuteInProcessResult) -> dict[str, Any]:
    (event,) = result.asset_materializations_for_node("augmentation_ablation")
    return {name: value.value for name, value in event.metadata.items()}


def why(result: dg.ExecuteInProcessResult) -> str:
    (failed,) = [event for event in result.all_events if event.is_step_failure]
    error = failed.step_failure_data.error
    return error.cause.message if error.cause else error.message


def test_runs_from_elsewhere_are_measured_recorded_and_served(project, runs):
    folder, recorded = project.policies("t1") / "augmentation_ablation", project.shipped_policies("t1")
    folder.mkdir()
    (folder / "augmented-seed7.csv").write_text("of an ablation before")
    said = told(ablate(runs=str(runs), commit=COMMIT, seeds=[5], preset="paper", options=["discriminator.style=0.1"]))
    assert said["origin"] == "trained elsewhere, measured here"
    assert said["what it is"] == "full trainings"
    assert said["iterations"].startswith("augmented-seed1 2, original-seed1 2, ")
    assert "data:image/png;base64" in said["D on policy samples"]
    assert len(said["command and push figures"].records) == 4
    shutil.copytree(folder, recorded / "augmentation_ablation")
    served = told(ablate())
    assert served["origin"] == "recorded, ships with the project; trained elsewhere, measured here"
    assert served["command and push figures"] == said["command and push figures"]


def test_what_is_recorded_is_that_of_the_runs(project, runs):
    assert ablate(runs=str(runs), commit=COMMIT, seeds=[5], preset="paper", options=["discriminator.style=0.1"]).success
    folder = project.policies("t1") / "augmentation_ablation"
    found = json.loads((folder / "ablation.json").read_text())
    assert (found["preset"], found["options"], found["trial"]) == ("paper", ["discriminator.style=0.4"], False)
    assert (found["database"], found["label"]) == ("d1", "mirror and time-scale only")
    names = ["augmented-seed1", "original-seed1", "augmented-seed2", "original-seed2"]
    assert [each["name"] for each in found["runs"]] == names
    assert {path.name for path in folder.iterdir()} == {"ablation.json", *(f"{name}.csv" for name in names)}
    assert (folder / "original-seed2.csv").read_text() == CURVES
    last = found["runs"][-1]
    assert (last["arm"], last["seed"], last["figures"]) == ("original", 2, {"error of original-seed2": 0.25})
    facts = last["run"]
    assert set(facts) == {"robot", "run", "trial", "commit", "command", "device", "network", "done"}
    assert (facts["robot"], facts["run"], facts["commit"]) == ("t1", "original-seed2", COMMIT)
    assert (facts["device"], facts["done"]["iterations"]) == ("NVIDIA H100 80GB HBM3", 2)
    assert "--bundle data/policies/t1/bundle" in facts["command"]
    assert facts["command"].endswith("--set discriminator.style=0.4 --set discriminator.use_augmented=false")


def test_runs_need_the_commit_that_trained_them(project, runs):
    for commit in ("", "HEAD"):
        said = why(ablate(runs=str(runs), commit=commit))
        assert f"'commit' is '{commit}'. 'runs' needs the hash of the commit whose code trained them" in said
    assert "'commit' is given without 'runs'" in why(ablate(commit=COMMIT))


def test_runs_that_are_no_ablation_fail_plainly_and_record_nothing(project, runs):
    change_config(runs / "original-seed1", lambda config: config.update(num_envs=512))
    said = why(ablate(runs=str(runs), commit=COMMIT))
    assert f"{runs}/original-seed1/config.json: differs from" in said
    assert not (project.policies("t1") / "augmentation_ablation").exists()


def test_the_ablation_that_ships_is_of_both_arms_and_whole():
    found = ablation.read_ablation(PROJECT, PROJECT.shipped_policies("t1") / "augmentation_ablation")
    card = json.loads((PROJECT.shipped_policies("t1") / "walk" / "card.json").read_text())
    assert (found["label"], found["trial"]) == ("mirror and time-scale only", False)
    assert found["database"] == card["data"]["digest"]
    assert {(each["arm"], each["seed"]) for each in found["runs"]} == {("augmented", 1), ("original", 1)}
    assert all(each["run"]["done"]["iterations"] > 600 for each in found["runs"])
    assert len(ablation.figure_rows(found).dropna()) == 46
