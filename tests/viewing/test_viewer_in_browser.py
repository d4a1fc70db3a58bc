"""Names and texts of strangers in the viewer's page, opened in a browser: they are shown, and nothing in them runs."""

import json
import shutil
import socket

import pytest

from pipeline.cli.view_command import clips_to_view
from pipeline.expert import DatabaseSettings, ExpertEntry, write_database
from pipeline.project import find_project
from pipeline.readers import Statement
from pipeline.viewing.viewer import Viewer
from tests.factories.browser import WAIT_S, chromium, listening
from tests.factories.robot_clips import wandering


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture
def listener():
    with listening() as running:
        yield running


def viewed(path, robot, root, monkeypatch) -> Viewer:
    """What `booster-lab view PATH` serves."""
    monkeypatch.chdir(root)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return Viewer(clips_to_view(find_project(), str(path), robot, Statement()), port=port)


def of_names(tmp_path, root, robot, listener):
    """A motion file whose name and whose folder's name are hostile."""
    folder = tmp_path / listener.hostile("folder")
    folder.mkdir()
    return shutil.copy(root / "data/motions/stand.bvh", folder / f"{listener.hostile('name')}.bvh")


def of_licence(tmp_path, root, robot, listener):
    """A clip of a database whose licence and name are hostile."""
    entry = ExpertEntry(
        clip=wandering(robot).cut(0, 60, "source/clip"), weight=1.0, skill="walk", licence="CC0-1.0", numbers={}
    )
    values = DatabaseSettings(max_lost_share=0.9, kept_versions=1)
    write_database(tmp_path / "t1", [entry], robot, stages={}, settings=values)
    (path,) = (each for each in (tmp_path / "t1").rglob("*.json") if "Licence" in each.read_text())
    clip = json.loads(path.read_text())
    hostile = tmp_path / f"{listener.hostile('name')}.json"
    hostile.write_text(json.dumps({**clip, "Licence": f"CC0 {listener.hostile('licence')}"}))
    return hostile


@pytest.mark.parametrize("made", [of_names, of_licence])
def test_hostile_texts_are_shown_and_do_not_run(tmp_path, root, robot, monkeypatch, browser, listener, made):
    viewer = viewed(made(tmp_path, root, robot, listener), robot, root, monkeypatch)
    page = browser.new_page()
    try:
        page.goto(f"http://127.0.0.1:{viewer.server.get_port()}")
        page.get_by_text("<iframe srcdoc=").first.wait_for(timeout=1_000 * WAIT_S)
        assert page.frames == [page.main_frame]
        for name in viewer.clip.options:
            viewer.clip.value = name
            viewer.step(0.0)
        assert not listener.waits_for("", 2.0), listener.asked
        viewer.text.content = listener.hostile("unescaped")  # so that the test can fail: this page runs what is HTML
        assert listener.waits_for("unescaped", WAIT_S)
        assert all("unescaped" in path for path in listener.asked)
    finally:
        page.close()
        viewer.stop()
