"""The web UI on a fresh clone: the graph without complaints, the button, the same bytes as the command's, and hostile
names of a folder and a file in its pages and in the viewer: shown, and nothing runs. One checkout, one story.
"""

import shutil
import socket

import pytest

from assets.definitions import defs
from pipeline.cli.view_command import clips_to_view
from pipeline.project import find_project
from pipeline.readers import Statement
from pipeline.viewing.viewer import Viewer
from tests.factories.browser import WAIT_S, chromium, listening
from tests.factories.checkout import ASSETS, Checkout
from tests.factories.web_ui import WebUi, web_ui

pytestmark = pytest.mark.command

FEW = ("stand", "curve_left")


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    """A checkout that need not repeat what `make expert_db` did here."""
    return Checkout.make(root, tmp_path_factory.mktemp("ui"), FEW).with_answers_of(root)


@pytest.fixture(scope="module")
def page(checkout):
    with web_ui(checkout) as running:
        yield running


def test_the_graph_is_shown_without_errors_or_warnings_of_ours(page: WebUi):
    nodes = page.ask("{assetNodes {assetKey {path} dependencyKeys {path} description}}")["assetNodes"]
    shown = {"/".join(node["assetKey"]["path"]) for node in nodes}
    assert shown == {key.to_user_string() for key in defs.resolve_asset_graph().get_all_asset_keys()}
    assert shown >= {*ASSETS, "raw_motions", "hardware_trials", "curation_feedback", "approved_weights"}
    assert all(node["description"] for node in nodes)
    complaints = [line for line in page.log.read_text().splitlines() if "ERROR" in line or "WARNING" in line]
    assert complaints == []


def test_the_button_on_a_fresh_clone_makes_the_database_that_the_command_makes(page, checkout, root, tmp_path):
    assert page.materialize("expert_db") == "SUCCESS"
    assert checkout.counts() == dict.fromkeys(ASSETS, 1)
    by_command = Checkout.make(root, tmp_path / "typed", FEW).with_answers_of(root)
    by_command.materialize()
    assert by_command.database() == checkout.database()


def test_after_that_the_page_calls_nothing_unsynced(page, checkout):
    assert page.stale_causes() == {}


def test_one_stage_alone_can_be_materialized_from_its_page(page, checkout):
    before = checkout.counts()
    assert page.materialize("repaired_motions") == "SUCCESS"
    after = checkout.counts()
    assert {name for name in ASSETS if after[name] > before[name]} == {"repaired_motions"}
    assert checkout.recomputed()["repaired_motions"] == 0


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def listener():
    with listening() as running:
        yield running


@pytest.fixture(scope="module")
def catalogued(checkout, page, listener) -> Checkout:
    """The checkout with a motion that is read and one that is refused, of hostile names, in its catalogue."""
    folder = checkout.root / "data/motions" / listener.hostile("folder")
    folder.mkdir()
    shutil.copy(checkout.root / "data/motions/stand.bvh", folder / f"{listener.hostile('name')}.bvh")
    (folder / f"{listener.hostile('refused')}.bvh").write_text("HIERARCHY\n")
    assert page.materialize("motion_catalog") == "SUCCESS"
    return checkout


def test_the_pages_of_a_run_show_hostile_names_as_text(page, catalogued, browser, listener):
    shown = browser.new_page()
    run = page.ask("{runsOrError {... on Runs {results {runId}}}}")["runsOrError"]["results"][0]["runId"]
    for address, text in (("assets/motion_catalog?view=events", "<iframe srcdoc="), (f"runs/{run}", run[:8])):
        shown.goto(f"{page.url}/{address}")
        shown.get_by_text(text).first.wait_for(timeout=1_000 * WAIT_S)
        assert not listener.waits_for("", 3.0), listener.asked
        assert shown.frames == [shown.main_frame]
    shown.close()


def test_the_viewer_shows_the_hostile_clip_of_the_catalogue_as_text(catalogued, browser, listener, robot, monkeypatch):
    monkeypatch.chdir(catalogued.root)
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
