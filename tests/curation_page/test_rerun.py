"""Clips that are sent through their stages again: which, by which run, and what came of them."""

import json
import sys
import time

import pytest
from starlette.testclient import TestClient

from pipeline.batch import ClipPool, Store
from pipeline.curation_page.app import make_app
from pipeline.curation_page.clip_table import read_table
from pipeline.curation_page.materialization import rerun_of, stage_of_line
from pipeline.curation_page.workplace import Workplace
from pipeline.errors import PipelineError
from tests.factories import curated_project as made

FAKE_DAGSTER = """#!{python}
import json, os, sys, time
from pathlib import Path
listed = json.loads(Path(os.environ["BOOSTER_LAB_AGAIN"]).read_text()) if "BOOSTER_LAB_AGAIN" in os.environ else None
Path("asked.json").write_text(json.dumps({{"arguments": sys.argv[1:], "again": listed}}))
print("augmented_motions: 3 clips, 2 known, 1 to work on", flush=True)
while Path("wait").exists():
    time.sleep(0.02)
"""


@pytest.fixture
def folder(root, robot, tmp_path):
    return made.curated_project(root, tmp_path / "project", robot)


@pytest.fixture
def table(folder):
    return read_table(Store(root=folder / "data/store"), "t1")


@pytest.fixture
def client(folder, tmp_path, monkeypatch):
    """The page of a project, where `dagster` is a script that notes what it was asked."""
    script = tmp_path / "bin/dagster"
    script.parent.mkdir()
    script.write_text(FAKE_DAGSTER.format(python=sys.executable))
    script.chmod(0o755)
    monkeypatch.setattr("pipeline.curation_page.materialization.sys.executable", str(script.with_name("python")))
    workplace = Workplace(folder, "t1", ClipPool(backend="sequential"))
    return TestClient(make_app(workplace, "right"), base_url="http://127.0.0.1:8090")


def post(client, name, value):
    headers = {"x-booster-lab-token": "right", "content-type": "application/json"}
    return client.post(f"/api/{name}", content=json.dumps(value), headers=headers)


def state_after_the_run(client):
    for _ in range(500):
        state = client.get("/api/state").json()
        if not state["at_work"]:
            return state
        time.sleep(0.02)
    raise AssertionError("the run never ended")


def test_a_clip_takes_all_that_it_was_made_from_with_it_and_nothing_else(table):
    rerun = rerun_of(table, [made.KEPT], "t1")
    assert set(rerun.names) == {made.RECORDING, made.WINDOW, f"{made.WINDOW}~mirror", made.KEPT}
    assert rerun.assets[0] == "motion_catalog" and rerun.assets[-2:] == ("feasible_motions", "expert_db")
    assert rerun_of(table, [made.KEPT], "k1").assets[2:4] == (
        "repaired_motions",
        "k1/retargeted_motions",
    )


@pytest.mark.parametrize("clip", [made.SKATING, made.NOT_TAKEN])
def test_a_rejected_clip_is_worked_on_again_too(table, clip):
    names = rerun_of(table, [clip], "t1").names
    assert clip.partition("@")[0] in names


def test_the_outcome_tells_same_changed_and_gone_apart(folder, table):
    store = Store(root=folder / "data/store")
    rerun = rerun_of(table, [made.KEPT, made.SLIPPING, made.NOT_TAKEN], "t1")
    assert rerun.outcome(table)["unchanged"]["count"] == 3
    feasible, selected = store.load("feasible_motions"), store.load("selected_motions")
    store.save("feasible_motions", feasible.without({made.KEPT: made.reason("x", "falls now")}))
    store.save("selected_motions", made.made("selected_motions", list(selected.entries), list(selected.judged[1:])))
    found = rerun.outcome(read_table(store, "t1"))
    assert (found["clips"], found["unchanged"]["clips"]) == (3, [made.SLIPPING])
    assert (found["changed"]["clips"], found["gone"]["clips"]) == ([made.KEPT], [made.NOT_TAKEN])


@pytest.mark.parametrize(("clips", "match"), [(["nobody"], "no clip 'nobody'"), ([], "no clip is named")])
def test_only_clips_of_the_table_are_run_again(client, table, clips, match):
    with pytest.raises(PipelineError, match=match):
        rerun_of(table, clips, "t1")
    answer = post(client, "rerun", {"clips": clips})
    assert answer.status_code == 404 and match in answer.json()["error"]
    assert client.get("/api/state").json()["run"] == 0


def test_the_run_gets_the_clips_shows_where_it_is_and_what_came_of_it(client, folder):
    (folder / "wait").touch()
    assert post(client, "rerun", {"clips": [made.KEPT]}).json() == {"done": 1}
    while not (state := client.get("/api/state").json())["stage"]:
        time.sleep(0.02)
    assert (state["stage"]["name"], state["stage"]["of"], state["rerun"]) == ("augmented_motions", 1, {"clips": 1})
    second = post(client, "rerun", {"clips": [made.SLIPPING]})
    assert second.status_code == 400 and "already in progress" in second.json()["error"]
    (folder / "wait").unlink()
    assert state_after_the_run(client)["rerun"]["unchanged"] == {"count": 1, "clips": [made.KEPT]}
    asked = json.loads((folder / "asked.json").read_text())
    assert asked["arguments"][:3] == ["asset", "materialize", "--select"]
    assert asked["arguments"][3].split(",")[-1] == "expert_db"
    assert made.KEPT in asked["again"]


def test_a_plain_run_works_on_nothing_again(client, folder, monkeypatch):
    monkeypatch.setenv("BOOSTER_LAB_AGAIN", "/of/another/run")
    assert post(client, "run", {}).status_code == 200
    assert state_after_the_run(client)["rerun"] is None
    assert json.loads((folder / "asked.json").read_text()) == {
        "arguments": ["asset", "materialize", "--select", "expert_db"],
        "again": None,
    }


def test_the_stage_at_work_and_its_time_left_are_read_from_its_lines():
    begun = stage_of_line("augmented_motions: 40 clips, 0 known, 40 to work on", {}, 10.0)
    later = stage_of_line("augmented_motions: 10 of 40 clips (25 %), 20 s, about 60 s left", begun, 30.0)
    assert (later["name"], later["done"], later["of"], later["left_s"]) == ("augmented_motions", 10, 40, 60)
