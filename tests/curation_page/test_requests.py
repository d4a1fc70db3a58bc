"""Who may do what at the server: pages of this machine read, and change things only with the token."""

import dataclasses
import json
import shutil

import pytest
import yaml
from starlette.testclient import TestClient

from pipeline.batch import ClipPool, Store
from pipeline.curation_page.app import make_app
from pipeline.curation_page.workplace import Workplace
from tests.factories import curated_project as made

TOKEN = "right"
HOST = "http://127.0.0.1:8090"


@pytest.fixture
def folder(root, robot, tmp_path):
    return made.curated_project(root, tmp_path / "project", robot)


@pytest.fixture
def client(folder):
    workplace = Workplace(folder, "t1", ClipPool(backend="sequential"))
    return TestClient(make_app(workplace, TOKEN), base_url=HOST, raise_server_exceptions=True)


def post(client, name, value, **headers):
    sent = {"x-booster-lab-token": TOKEN, "content-type": "application/json", **headers}
    return client.post(f"/api/{name}", content=json.dumps(value), headers={k: v for k, v in sent.items() if v})


EXCLUDE = {"clips": [made.KEPT], "verdict": "exclude", "by": "Ada", "why": "it limps"}


def decisions(folder):
    return yaml.safe_load((folder / "data/curation.yaml").read_text()).get("decisions", [])


def test_a_decision_is_written_shown_and_taken_back(client, folder):
    assert post(client, "decide", EXCLUDE).json() == {"done": 1}
    assert [(each["clip"], each["by"]) for each in decisions(folder)] == [(made.KEPT, "Ada")]
    found = client.get("/api/clip", params={"name": made.KEPT}).json()
    assert found["decisions"][0]["why"] == "it limps"
    assert post(client, "take_back", {"clips": [made.KEPT]}).status_code == 200
    assert decisions(folder) == []


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"x-booster-lab-token": ""}, 403),
        ({"x-booster-lab-token": "guessed"}, 403),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "http://127.0.0.1:3000"}, 403),
        ({"origin": "null"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-site"}, 403),
        ({"content-type": "text/plain"}, 415),
        ({"content-type": "application/x-www-form-urlencoded"}, 415),
        ({"host": "evil.example"}, 421),
        ({"host": "evil.example:8090"}, 421),
        ({"host": "127.0.0.1.evil.example"}, 421),
    ],
)
def test_a_change_that_is_not_of_this_page_is_refused(client, folder, headers, status):
    assert post(client, "decide", EXCLUDE, **headers).status_code == status
    assert decisions(folder) == []


CHANGES = ("decide", "take_back", "run", "rerun", "approve", "decline", "take_back_sections", "stop")


@pytest.mark.parametrize("name", CHANGES)
def test_nothing_is_changed_by_get(client, folder, name):
    answer = client.get(f"/api/{name}", params=EXCLUDE, headers={"x-booster-lab-token": TOKEN})
    assert answer.status_code == 405
    assert client.put(f"/api/{name}", headers={"x-booster-lab-token": TOKEN}).status_code == 405
    assert client.options(f"/api/{name}", headers={"origin": "http://evil.example"}).status_code == 405
    assert decisions(folder) == []


@pytest.mark.parametrize("host", ["evil.example", "192.168.0.5:8090", "", "localhost.evil.example"])
def test_nothing_is_read_under_a_foreign_name(client, host):
    assert client.get("/api/clips", headers={"host": host}).status_code == 421


def test_every_answer_forbids_scripts_of_others_and_frames(client):
    for path in ("/", "/static/main.js", "/api/clips", "/api/decide", "/nothing"):
        policy = client.get(path).headers["content-security-policy"]
        assert "script-src 'self'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy
        assert "access-control-allow-origin" not in client.get(path).headers


@pytest.mark.parametrize(
    ("value", "match"),
    [
        ({**EXCLUDE, "clips": ["nobody"]}, "there is no clip 'nobody'"),
        ({**EXCLUDE, "clips": []}, "no clip is named"),
        ({**EXCLUDE, "why": " "}, "'why' is missing"),
        ({**EXCLUDE, "verdict": "burn"}, "'verdict' is 'burn'"),
        ({**EXCLUDE, "clips": "all"}, "not a list of texts"),
        ([1], "not a JSON object"),
        ({**EXCLUDE, "why": "two\nlines"}, "allowed is one line"),
    ],
)
def test_a_faulty_change_gets_a_sentence_and_changes_nothing(client, folder, value, match):
    answer = post(client, "decide", value)
    assert answer.status_code in (400, 404)
    assert match in answer.json()["error"]
    assert decisions(folder) == []


def test_the_table_motion_and_thumbnails_are_served(client):
    found = client.get("/api/clips").json()
    place = found["clip"].index(made.KEPT)
    thumbnail = client.get(f"/thumbnails/{found['thumbnail'][place]}")
    assert thumbnail.status_code == 200 and "immutable" in thumbnail.headers["cache-control"]
    assert len(client.get("/api/motion", params={"name": made.KEPT}).content) > len(thumbnail.content) > 1000
    assert client.get("/thumbnails/..%2f..%2fcuration.yaml").status_code == 404
    assert client.get(f"/thumbnails/{'0' * 32}").status_code == 404
    assert client.get("/static/../app.py").status_code == 404
    assert client.get("/api/motion", params={"name": "nobody"}).status_code == 404


def test_a_stored_motion_that_comes_back_gets_its_thumbnail(client, folder):
    found = client.get("/api/clips").json()
    address = f"/thumbnails/{found['thumbnail'][found['clip'].index(made.KEPT)]}"
    blobs = folder / "data/store/blobs"
    shutil.rmtree(folder / "data/store/thumbnails", ignore_errors=True)
    blobs.rename(folder / "aside")
    lost = client.get(address)
    assert lost.content == b"" and lost.headers["cache-control"] == "no-store"
    (folder / "aside").rename(blobs)
    assert len(client.get(address).content) > 1000


def test_a_manifest_that_changed_is_read_again(client, folder):
    from pipeline.batch import Store

    before = client.get("/api/clips").json()
    store = Store(root=folder / "data/store")
    feasible = store.load("feasible_motions")
    store.save("feasible_motions", feasible.without({made.KEPT: made.reason("x", "gone")}))
    after = client.get("/api/clips").json()
    assert after["version"] != before["version"]
    verdict = after["texts"]["verdict"]
    assert verdict["names"][verdict["codes"][after["clip"].index(made.KEPT)]] == "rejected"


def test_a_project_without_proposals_and_databases_says_so(client):
    assert "never materialized" in client.get("/api/proposals").json()["missing"]
    assert client.get("/api/databases").json() == []
    answer = client.get("/api/compare", params={"before": "current", "after": "current"})
    assert answer.status_code == 404


def test_the_release_page_is_served_with_its_style_and_nothing_else(client, folder):
    assert "Run: dagster asset materialize --select release_report\n" in client.get("/release").text
    (folder / "robots/k1").mkdir()
    (folder / "robots/k1/robot.toml").touch()
    assert "Run: dagster asset materialize --select k1/release_report\n" in client.get("/release/k1").text
    assert client.get("/release/k9").text == "unknown robot 'k9'; there are: k1, t1\n"
    path = folder / "data/release/t1/release_report.html"
    path.parent.mkdir(parents=True)
    path.write_text("<!doctype html><title>Release</title>")
    for address in ("/release", "/release/t1"):
        answer = client.get(address)
        assert answer.text == path.read_text()
        policy = answer.headers["content-security-policy"]
        assert policy.startswith("default-src 'none'; img-src data:; style-src 'sha256-") and "unsafe" not in policy
    for address in ("/release/k9", "/release/..%2f..%2fdata"):
        assert client.get(address).status_code == 404


def test_a_decision_may_name_the_window_of_a_repaired_piece(client, folder):
    store = Store(root=folder / "data/store")
    manifest = store.load("feasible_motions").at_hand()
    piece = made.judged("lab/jump@0-99+1~mirror~rollout", None, made.reason("foot_slip_p95", "feet slide"))
    store.save("feasible_motions", dataclasses.replace(manifest, judged=(*manifest.judged, piece)))
    names = client.get("/api/clip", params={"name": piece.clip}).json()["names"]
    assert names == [piece.clip, "lab/jump@0-99", "lab/jump"]
    assert [post(client, "decide", {**EXCLUDE, "clips": [name]}).status_code for name in names] == [200, 200, 200]
