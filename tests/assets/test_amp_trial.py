"""The training itself, started by its asset on a machine without a GPU: two iterations of eight environments."""

import csv
import json
import shutil
from typing import Any

import dagster as dg
import pytest

from assets import amp_policy, policy, resources, training_process
from assets.plan import SHARED, robot_plans
from assets.resources import ClipPoolResource, StoreIOManager
from pipeline.actuators.adapted_robot import adapt, write_adapted_robot
from pipeline.deployment import load_policy
from pipeline.expert import ExpertEntry, write_database
from pipeline.export.metadata import trained_task
from pipeline.project import Project
from tests.factories.robot_clips import standing, wandering
from tests.factories.sweeps import SETTINGS

TRAINED = robot_plans("t1")["amp_policy"]


@pytest.fixture
def project(tmp_path, root, robot, monkeypatch):
    """A project with a database of two clips and the robot adapted to no measurements."""
    project = Project(tmp_path)
    for folder in ("robots/t1", "data"):
        ignored = shutil.ignore_patterns("policies", "motions", "store", "expert_db", "adapted_robot", ".dagster")
        shutil.copytree(root / folder, tmp_path / folder, ignore=ignored)
    clips = {"source/stand": standing(robot, seconds=3.0), "source/wander": wandering(robot, seconds=3.0)}
    entries = [
        ExpertEntry(
            clip=clip.cut(0, len(clip.joint_pos), name),
            weight=1.0,
            skill="walk",
            licence="CC0-1.0",
            numbers={"variant": "original"},
            stages={},
        )
        for name, clip in clips.items()
    ]
    write_database(project.expert_db("t1"), entries, robot, stages={})
    write_adapted_robot(project.adapted_robot("t1"), root / "robots" / "t1", adapt(robot, [], SETTINGS))
    for module in (amp_policy, policy, resources):
        monkeypatch.setattr(module, "PROJECT", project)
    monkeypatch.setattr(training_process, "gpus_here", lambda: 0)
    return project


def test_the_asset_trains_and_says_that_it_is_a_trial(project, robot):
    result = dg.materialize(
        [amp_policy.amp_policy(TRAINED)],
        resources={"io_manager": StoreIOManager(bootstrap=False), "clip_pool": ClipPoolResource(workers=1)},
    )
    (event,) = result.asset_materializations_for_node("t1__amp_policy")
    said: dict[str, Any] = {name: value.value for name, value in event.metadata.items()}
    assert said["type of run"].startswith("a trial")
    assert said["strictest licence"] == "public-domain"
    (facts,) = project.store.load("t1/amp_policy").settings.values()
    run = project.root / facts["folder"]
    config = json.loads((run / "config.json").read_text())
    assert (config["num_envs"], config["device"], config["seed"]) == (8, "cpu", 1)
    assert config["bundle"]["database_digest"] == said["expert database"]
    rows = list(csv.DictReader((run / "curves.csv").read_text().splitlines()))
    assert [row["iteration"] for row in rows] == ["1", "2"]
    assert all(
        float(row[name]) == float(row[name]) for row in rows for name in ("task_reward", "d_expert", "d_rollout")
    )
    network = load_policy(run / facts["policy"])
    assert (network.observation_size, network.action_size) == (720, 21)
    assert trained_task(robot, network).kp.tolist() == robot.kp.tolist()


def test_a_run_that_materializes_everything_trains_nothing(project):
    @dg.asset(key=SHARED[0].key)
    def everything_else():
        return 1

    result = dg.materialize(
        [everything_else, amp_policy.amp_policy(TRAINED)],
        resources={"io_manager": dg.mem_io_manager, "clip_pool": ClipPoolResource(workers=1)},
    )
    assert result.success
    assert result.asset_materializations_for_node("t1__amp_policy") == []
    assert not project.policy_runs("t1").exists()
