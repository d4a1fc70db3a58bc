"""What the asset of the database hands to its writer."""

from assets import database
from pipeline.batch import Entry, Manifest
from pipeline.project import Project
from tests.factories.robot_clips import standing


def test_an_entry_of_the_database_says_the_parameters_of_every_stage(tmp_path, robot, monkeypatch):
    project = Project(tmp_path)
    monkeypatch.setattr(database, "PROJECT", project)
    record = tuple({"stage": name, "version": "1", "settings": f"digest of {name}", "reasons": []} for name in "ab")
    settings = {f"digest of {name}": {"stage": name, "limit": limit} for name, limit in (("a", 1.5), ("b", [2, 3]))}
    numbers = {"weight": 1.0, "skill": "walk", "licence": "MIT"}
    entry = Entry(clip="mine/walk", blob=project.store.put_clip(standing(robot)), numbers=numbers, record=record)
    manifest = Manifest(stage="b", entries=(entry,), judged=(), settings=settings)
    (found,) = database._entries(manifest)
    assert [(each["stage"], each["settings"], each["parameters"]) for each in found.stages["stages"]] == [
        ("a", "digest of a", {"stage": "a", "limit": 1.5}),
        ("b", "digest of b", {"stage": "b", "limit": [2, 3]}),
    ]
