"""The README's command, typed literally, after each kind of change. One checkout, one story."""

import shutil

import pytest

from tests.factories.checkout import ASSETS, Checkout

pytestmark = pytest.mark.command

FEW = ("stand", "walk_curve", "side_left")
"""Shipped motions the checkout starts with."""


@pytest.fixture(scope="module")
def checkout(root, tmp_path_factory) -> Checkout:
    """A checkout in which nothing was ever materialized."""
    return Checkout.make(root, tmp_path_factory.mktemp("checkout"), FEW)


@pytest.fixture(scope="module")
def materialized(checkout) -> Checkout:
    """The checkout after the first command."""
    checkout.materialize()
    return checkout


def test_a_fresh_clone_gets_a_database_from_one_command(materialized):
    assert materialized.counts() == dict.fromkeys(ASSETS, 1)
    assert materialized.clips() == {f"{name}.bvh" for name in FEW}


def test_nothing_stale_is_said_and_nothing_is_done(materialized):
    before, database = materialized.counts(), materialized.database()
    printed = materialized.materialize()
    assert "nothing is stale" in printed
    assert materialized.counts() == before
    assert materialized.database() == database


def test_a_clip_added_is_worked_on_alone_and_a_deleted_one_leaves_the_database(materialized, root):
    database = materialized.database()
    motions = materialized.root / "data/motions"
    shutil.copy2(motions / "side_left.bvh", motions / "added.bvh")
    materialized.materialize()
    assert "added.bvh" in materialized.clips()
    recomputed = materialized.recomputed()
    assert recomputed["motion_catalog"] == 1
    assert recomputed["selected_motions"] == 1
    added = [row for row in materialized.history()["feasible_motions"][0] if row]
    assert added
    (motions / "added.bvh").unlink()
    materialized.materialize()
    assert "added.bvh" not in materialized.clips()
    assert set(materialized.recomputed().values()) == {0}
    assert materialized.database() == database


def test_a_clip_changed_is_worked_on_alone(materialized):
    path = materialized.root / "data/motions/stand.bvh"
    text = path.read_text()
    path.write_text(text.replace("Frame Time: ", "Frame Time:  "))
    materialized.materialize()
    recomputed = materialized.recomputed()
    assert recomputed["motion_catalog"] == 1
    path.write_text(text)
    materialized.materialize()
    assert set(materialized.recomputed().values()) == {0}


def test_a_threshold_changed_recomputes_from_its_stage_on(materialized):
    before = materialized.counts()
    path = materialized.root / "data/augment.yaml"
    path.write_text(path.read_text() + "\n# a remark changes no value\n")
    materialized.materialize()
    assert materialized.counts() == before
    settings = materialized.root / "data/feasibility.yaml"
    assert settings.is_file()
