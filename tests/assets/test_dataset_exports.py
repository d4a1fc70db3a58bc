"""The database as other programs load it, in the graph: one optional asset each, stale when its files are gone."""

import shutil

import dagster as dg
import pytest

from assets import database, policy
from assets.database import dataset_exports as export_assets
from assets.freshness import stored_version
from assets.plan import EXPORTS, SHARED, robot_plans
from pipeline.dataset_export import FORMATS
from pipeline.expert import ExpertEntry, write_database
from pipeline.expert.dataset_card import STAGES
from pipeline.project import Project
from pipeline.readers import read_motion
from tests.factories.robot_clips import wandering

PLANS = robot_plans("t1")
DATABASE = PLANS["expert_db"]


@pytest.fixture
def project(tmp_path, root, robot, monkeypatch):
    """A project with a database of two clips."""
    project = Project(tmp_path)
    shutil.copytree(root / "robots" / "t1", project.robot_folder("t1"), ignore=shutil.ignore_patterns("policies"))
    entries = [
        ExpertEntry(
            clip=wandering(robot, seed=index).cut(0, 60, f"a/walk {index}"),
            weight=1.0,
            skill="walk",
            licence="CC0-1.0",
            numbers={"file": "a.bvh", "source": "a", "credit": "", "variant": "original"},
            stages={},
        )
        for index in range(2)
    ]
    write_database(project.expert_db("t1"), entries, robot, stages={})
    for module in (database, policy):
        monkeypatch.setattr(module, "PROJECT", project)
    return project


class Store(dg.IOManager):
    """Manifests into the project's store."""

    def __init__(self, project):
        self.project = project

    def handle_output(self, context, obj):
        self.project.store.save(context.asset_key.to_user_string(), obj)

    def load_input(self, context):
        raise AssertionError("no export takes an input")


def ran(project, **options):
    assets = [dg.AssetSpec(DATABASE.key), *export_assets("t1")]
    return dg.materialize(assets, resources={"io_manager": Store(project)}, **options)


def test_every_format_of_the_command_is_an_asset(project):
    pytest.importorskip("rerun", reason="the extra booster-lab[export] is not installed")
    assert tuple(EXPORTS) == FORMATS
    assert ran(project).success
    for kind, name in EXPORTS.items():
        plan = PLANS[name]
        folder = project.data / "exports/t1" / kind
        assert (folder / "README.md").is_file()
        facts = project.store.load(plan.key.to_user_string()).settings["export"]
        assert facts["clips"] == 2
        assert set(facts["files"]) == {
            path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
        }
        assert stored_version(project, plan) is not None
    archive = next((project.data / "exports/t1/mjlab").glob("*.npz"))
    assert read_motion(archive, "clip").clip.frame_count == 60
    archive.unlink()
    assert stored_version(project, PLANS[EXPORTS["mjlab"]]) is None


def test_the_card_explains_stages_that_the_graph_has():
    assert set(STAGES) <= {plan.name for plan in (*SHARED, *PLANS.values())}


def test_a_format_whose_package_is_missing_fails_in_one_sentence_and_keeps_what_was_there(project, monkeypatch):
    folder = project.data / "exports/t1/rerun"
    folder.mkdir(parents=True)
    (folder / "old.rrd").write_bytes(b"old")
    monkeypatch.setitem(__import__("sys").modules, "rerun", None)
    result = ran(project, raise_on_error=False, selection=[PLANS[EXPORTS["rerun"]].key])
    (failure,) = [event for event in result.all_events if event.is_step_failure]
    assert "pip install 'booster-lab[export]'" in failure.event_specific_data.error_display_string
    assert [path.name for path in folder.iterdir()] == ["old.rrd"]
