"""`tracking_policy`: serves what ships, trains by request or before a policy, serves a full training and no trial."""

import csv
import json
import logging
import shutil
from pathlib import Path
from typing import Any

import dagster as dg
import pytest

from assets import bootstrap, definitions, freshness, resources, tracker_choice, tracking_policy, training_process
from assets.plan import SHARED, plans, robot_plans
from assets.resources import ClipPoolResource, StoreIOManager
from assets.training_process import TrainingFailedError
from pipeline.actuators.adapted_robot import adapt, write_adapted_robot
from pipeline.batch import Entry, Manifest
from pipeline.project import Project
from pipeline.robot import Robot
from pipeline.tracking.__main__ import main
from pipeline.tracking.tracker import load_tracker
from pipeline.tracking.tracker_folder import read_card
from tests.factories.robot_clips import standing
from tests.factories.sweeps import SETTINGS

PLANS = robot_plans("t1")


@pytest.fixture
def project(tmp_path: Path, root: Path, robot: Robot, monkeypatch) -> Project:
    """A project with the tracker that ships and two references."""
    project = Project(tmp_path)
    shutil.copytree(root / "robots" / "t1", tmp_path / "robots" / "t1")
    write_adapted_robot(project.adapted_robot("t1"), root / "robots" / "t1", adapt(robot, [], SETTINGS))
    clips = [standing(robot, seconds=1.0, name="test/a"), standing(robot, seconds=0.6, name="test/b")]
    entries = tuple(
        Entry(clip=clip.name, blob=project.store.put_clip(clip), numbers={"licence": "CC0-1.0"}) for clip in clips
    )
    project.store.save("reference_motions", Manifest(stage="reference_motions", entries=entries, judged=()))
    project.store.save("adapted_robot", Manifest(stage="adapted_robot", entries=(), judged=()))
    for module in (tracking_policy, resources):
        monkeypatch.setattr(module, "PROJECT", project)
    monkeypatch.setattr(training_process, "gpus_here", lambda: 0)
    return project


def materialized(**config: Any) -> dict[str, Any]:
    """Metadata of the asset materialized alone, with what is stored of its inputs."""
    made = tracking_policy.tracking_policy(PLANS["tracking_policy"])
    result = dg.materialize(
        [made, *(dg.AssetSpec(PLANS[name].key) for name in ("reference_motions", "adapted_robot"))],
        resources={"io_manager": StoreIOManager(bootstrap=False), "clip_pool": ClipPoolResource(workers=1)},
        run_config={"ops": {"tracking_policy": {"config": config}}},
    )
    (event,) = result.asset_materializations_for_node("tracking_policy")
    return {name: value.value for name, value in event.metadata.items()}


def test_the_shipped_tracker_is_served_and_a_trial_is_not(project: Project):
    assert materialized()["origin"] == tracker_choice.SHIPPED
    assert not (project.policies("t1") / "tracker_runs").exists(), "nothing is trained without a request"
    found = materialized(train=tracker_choice.ALWAYS, num_envs=2)
    assert (found["origin"], found["references it was not trained on"]) == (tracker_choice.SHIPPED, 2)
    (run,) = (project.policies("t1") / "tracker_runs").iterdir()
    assert run.name.startswith("trial-seed1-")
    assert json.loads((run / "config.json").read_text())["num_envs"] == 2
    rows = list(csv.DictReader((run / "curves.csv").read_text().splitlines()))
    assert [row["iteration"] for row in rows] == ["1", "2"]
    assert not (project.policies("t1") / "tracker").exists()


def test_what_is_trained_on_a_gpu_is_exported_and_served(project: Project, robot: Robot, monkeypatch):
    """The command of a GPU's run, with the CPU in its place."""
    ran: list[tuple[str, ...]] = []

    def on_the_cpu(run: training_process.Run, root: Path, lock: Path, log: logging.Logger) -> None:
        ran.append(run.command)
        assert root == project.root and lock == project.training_lock
        command = ["cpu" if word == "cuda" else word for word in run.command]
        assert main(command[command.index("pipeline.tracking") + 1 :]) == 0

    monkeypatch.setattr(training_process, "gpus_here", lambda: 1)
    monkeypatch.setattr(tracking_policy, "train", on_the_cpu)
    found = materialized(train=tracker_choice.ALWAYS, num_envs=2, iterations=1)
    (command,) = ran
    assert command[:2] == ("-m", "pipeline.tracking") and command[-1] == "--resume"
    assert command[command.index("--device") + 1] == "cuda" and command[command.index("--minutes") + 1] == "30"
    assert (found["origin"], found["training clips"]) == (tracker_choice.TRAINED, "2 clips")
    assert found["references it was not trained on"] == 0
    card = read_card(project.policies("t1") / "tracker")
    assert (card.clips, card.licences, card.training["iterations"]) == (("test/a", "test/b"), ("CC0-1.0",), 1)
    assert card.training["command"].startswith("python -m pipeline.tracking --bundle data/policies/t1/tracking_bundle")
    stored = tracker_choice.tracker_file(project, project.store.load("tracking_policy"))
    assert stored is not None
    assert load_tracker(stored[0], robot).controlled == robot.controlled
    assert stored[0] == project.policies("t1") / "tracker" / "tracker.npz"


def test_several_gpus_are_used_by_torchrun_and_missing_ones_refused(project: Project, monkeypatch):
    monkeypatch.setattr(training_process, "gpus_here", lambda: 2)
    config = tracking_policy.TrackerConfig(train=tracker_choice.ALWAYS, gpus=2)
    run = tracking_policy._run_of(config, project.root, project.root / "bundle", "content")
    assert run.command[:4] == ("-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2")
    sizes = [run.command[run.command.index(name) + 1] for name in ("--num-envs", "--iterations")]
    assert sizes == ["4096", str(tracking_policy.ITERATIONS)]
    other = tracking_policy._run_of(config, project.root, project.root / "bundle", "other content")
    assert other.folder != run.folder, "other references begin another run"
    for device in ("auto", "cuda"):
        asked = tracking_policy.TrackerConfig(train=tracker_choice.ALWAYS, device=device, gpus=4)
        with pytest.raises(TrainingFailedError, match="4 GPUs are requested, 2 are available"):
            tracking_policy._run_of(asked, project.root, project.root / "bundle", "content")


def test_a_robot_without_a_tracker_has_none_and_the_page_says_so(project: Project):
    shutil.rmtree(project.shipped_policies("t1") / "tracker")
    assert materialized()["origin"].startswith("there is no tracker of 't1'")
    assert tracker_choice.tracker_file(project, project.store.load("tracking_policy")) is None


def test_before_a_policy_a_tracker_is_trained_once_on_other_clips(project: Project, monkeypatch):
    trained: list[Path] = []

    def on_the_cpu(run: training_process.Run, root: Path, lock: Path, log: logging.Logger) -> None:
        trained.append(run.folder)
        command = ["cpu" if word == "cuda" else word for word in run.command]
        assert main(command[command.index("pipeline.tracking") + 1 :]) == 0

    monkeypatch.setattr(training_process, "gpus_here", lambda: 1)
    monkeypatch.setattr(tracking_policy, "train", on_the_cpu)
    for _ in range(2):
        found = materialized(train=tracker_choice.CHANGED, num_envs=2, iterations=1)
        assert (found["origin"], found["references it was not trained on"]) == (tracker_choice.TRAINED, 0)
    assert len(trained) == 1


def test_a_tracker_is_needed_for_a_policy_on_a_gpu_whose_clips_it_was_not_trained_on(project: Project, monkeypatch):
    policy, tracker, references = (PLANS[name].key for name in ("amp_policy", "tracking_policy", "reference_motions"))

    def needed(selected: set[dg.AssetKey], stale: set[dg.AssetKey], **config: Any) -> Any:
        run_config = {"ops": {"t1__amp_policy": {"config": config}}}
        return tracker_choice.trackers_for(selected, run_config, stale, project)

    assert needed({policy}, set()) == {}, "no GPU"
    monkeypatch.setattr(tracker_choice, "gpus_here", lambda: 2)
    assert needed({policy}, set(), gpus=2, seed=3) == {tracker: {"train": "changed", "gpus": 2}}
    assert needed({policy}, set(), device="cpu") == {}
    assert needed({PLANS["expert_db"].key}, set()) == {}, "the database alone trains nothing"
    assert needed({policy, SHARED[0].key}, set()) == {}, "nor does a run of everything"
    served = read_card(project.shipped_policies("t1") / "tracker")
    entries = tuple(Entry(clip=name, blob="", numbers={}) for name in served.clips[:2])
    project.store.save("reference_motions", Manifest(stage="reference_motions", entries=entries, judged=()))
    assert needed({policy}, set()) == {}, "the served tracker knows these clips"
    assert needed({policy}, {references}) == {tracker: {"train": "changed"}}, "known once they are made"


def test_the_database_is_made_again_with_a_new_tracker():
    bootstrap.serve(definitions.defs)
    known = plans(Project(Path.cwd()))
    parents = {key: above & set(known) for key, above in bootstrap._parents().items() if key in known}
    with dg.DagsterInstance.ephemeral() as instance, pytest.MonkeyPatch.context() as patch:
        patch.setattr(freshness, "_why_by_itself", lambda *_: "")
        found = freshness.stale_reasons(
            instance, Project(Path.cwd()), known, parents, {}, {PLANS["tracking_policy"].key: "needed"}
        )
    names = [key.to_user_string() for key in found]
    assert names[:4] == ["tracking_policy", "augmented_motions", "feasible_motions", "expert_db"]
    assert found[PLANS["augmented_motions"].key] == "'tracking_policy' is stale"
    assert "reference_motions" not in names and "k1/expert_db" not in names
