"""The web UI on a fresh clone: the graph without complaints, the button, and the same bytes as the command's."""

import pytest

from assets.definitions import defs
from tests.factories.checkout import ASSETS, Checkout
from tests.factories.web_ui import WebUi, web_ui

pytestmark = pytest.mark.command

FEW = ("stand", "curve_left")


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    """A checkout that need not repeat what `make expert_db` did here; the typed command below works afresh."""
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
    by_command = Checkout.make(root, tmp_path / "typed", FEW)
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
