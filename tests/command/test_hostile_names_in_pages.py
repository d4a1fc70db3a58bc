"""Hostile names of a folder and a file in Dagster's pages and in the viewer after a run: shown, and nothing runs."""

import shutil
import socket

import pytest

from pipeline.cli.project import find_project
from pipeline.cli.view_command import clips_to_view
from pipeline.readers import Statement
from pipeline.viewing.viewer import Viewer
from tests.factories.browser import WAIT_S, chromium, listening
from tests.factories.checkout import Checkout
from tests.factories.web_ui import web_ui

pytestmark = pytest.mark.command


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def listener():
    with listening() as running:
        yield running


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory, listener):
    """A checkout with a motion that is read and one that is refused, of hostile names."""
    made = Checkout.make(root, tmp_path_factory.mktemp("hostile"), ("stand",))
    folder = made.root / "data/motions" / listener.hostile("folder")
    folder.mkdir()
    shutil.copy(root / "data/motions/stand.bvh", folder / f"{listener.hostile('name')}.bvh")
    (folder / f"{listener.hostile('refused')}.bvh").write_text("HIERARCHY\n")
    return made


def test_the_pages_of_a_run_show_hostile_names_as_text(checkout, browser, listener):
    with web_ui(checkout) as running:
        assert running.materialize("motion_catalog") == "SUCCESS"
        page = browser.new_page()
        run = running.ask("{runsOrError {... on Runs {results {runId}}}}")["runsOrError"]["results"][0]["runId"]
        for address, shown in (("assets/motion_catalog?view=events", "<iframe srcdoc="), (f"runs/{run}", run[:8])):
            page.goto(f"{running.url}/{address}")
            page.get_by_text(shown).first.wait_for(timeout=1_000 * WAIT_S)
            assert not listener.waits_for("", 3.0), listener.asked
            assert page.frames == [page.main_frame]
        page.close()


def test_the_viewer_shows_the_hostile_clip_of_the_catalogue_as_text(checkout, browser, listener, robot, monkeypatch):
    monkeypatch.chdir(checkout.root)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    name = f"booster_lab/{listener.hostile('folder')}/{listener.hostile('name')}"
    viewer = Viewer(clips_to_view(find_project(), name, robot, Statement()), port=port)
    page = browser.new_page()
    try:
        page.goto(f"http://127.0.0.1:{viewer.server.get_port()}")
        page.get_by_text(f"{listener.address}&#47;folder-script").first.wait_for(timeout=1_000 * WAIT_S)
        assert not listener.waits_for("", 2.0), listener.asked
    finally:
        page.close()
        viewer.stop()
