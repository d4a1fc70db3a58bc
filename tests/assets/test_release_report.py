"""The release report gathers what is materialized, and says of all else that it was not run."""

import io
import shutil
from types import SimpleNamespace

import dagster as dg
import numpy as np
import pytest
from PIL import Image

from assets import release
from assets.plan import RELEASED, Plan
from assets.report import picture
from pipeline.batch import Manifest
from pipeline.export.folder import Source, export_policy
from pipeline.project import Project
from pipeline.release.dossier import Status
from pipeline.release.page import page
from tests.factories.networks import network_file

KNOWN = {name: Plan(name, "validation", (), robot="t1") for name in RELEASED}
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def project(tmp_path, root, robot, monkeypatch):
    project = Project(tmp_path)
    for folder in (project.robot_folder("t1"), project.adapted_robot("t1")):
        shutil.copytree(root / "robots" / "t1", folder, ignore=shutil.ignore_patterns("policies"))
    monkeypatch.setattr(release, "PROJECT", project)
    monkeypatch.setattr("assets.policy.PROJECT", project)
    return project


@pytest.fixture
def digest_of_policy(project, robot):
    """A policy is exported; its digest."""
    licence = {"strictest": "attribution", "allowed_use": "Any use; name the sources."}
    source = Source(
        policy=network_file(project.root / "a.npz", robot),
        run={"name": "run7"},
        data={"digest": "d1", "licence": licence},
    )
    folder = project.exported_policy("t1")
    card = export_policy(folder, "walk", robot, source, np.random.default_rng(0), shippable=False)
    facts = {
        "digest": card.digest,
        "name": "walk",
        "origin": "trained here",
        "database": "d1",
        "folder": folder.relative_to(project.root).as_posix(),
    }
    store(project, "exported_policy", facts)
    return card.digest


def store(project, name, facts):
    project.store.save(name, Manifest(stage=name, entries=(), judged=(), settings={"result": facts}))


def gathered(project, instance, stale=None):
    return release.gather(instance, project, "t1", KNOWN, stale or {})


def test_with_nothing_there_nothing_was_run(project):
    with dg.DagsterInstance.ephemeral() as instance:
        dossier = gathered(project, instance)
    assert dossier.policy == ""
    assert {each.status for each in dossier.verdicts} == {Status.NOT_RUN}
    assert dossier.open_points == ("there is no policy",)
    assert {origin.remark for origin in dossier.lineage} == {"never materialized here"}


def test_each_result_is_shown_as_what_it_is(project, digest_of_policy):
    store(project, "mujoco_validation", {"passed": True, "policy": digest_of_policy, "reasons": []})
    store(project, "cross_engine_validation", {"passed": False, "policy": digest_of_policy, "reasons": ["turn: fell"]})
    store(project, "webots_validation", {"passed": None, "policy": digest_of_policy, "not_run": ["webots not found"]})
    store(project, "limit_cycles", {"passed": True, "policy": "another"})
    with dg.DagsterInstance.ephemeral() as instance:
        dossier = gathered(project, instance)
        again = gathered(project, instance, {KNOWN["mujoco_validation"].key: "'exported_policy' has new content"})
    found = {each.name: (each.status, each.reasons) for each in dossier.verdicts}
    assert found["mujoco_validation"] == (Status.PASSED, ())
    assert found["cross_engine_validation"] == (Status.FAILED, ("turn: fell",))
    assert found["webots_validation"] == (Status.NOT_RUN, ("webots not found",))
    assert found["limit_cycles"][0] is Status.OUTDATED
    assert again.verdicts[0].status is Status.OUTDATED
    assert again.verdicts[0].reasons == ("it is stale: 'exported_policy' has new content",)
    rows = dict(dossier.card)
    assert (rows["run"], rows["origin"], rows["may ship"].split(".")[0]) == ("run7", "trained here", "no")
    text = page(dossier)
    assert text == page(dossier)
    for said in ("turn: fell", "webots not found", "attribution: Any use; name the sources."):
        assert said in text


def test_a_result_that_does_not_say_whether_it_passed_was_not_run():
    silent = Manifest(stage="x", entries=(), judged=(), settings={"result": {"cells": 3}})
    twice = Manifest(stage="x", entries=(), judged=(), settings={"a": {"passed": True}, "b": {"passed": True}})
    for manifest, times in ((silent, 0), (twice, 2)):
        assert release.result_in(manifest) == {
            "passed": None,
            "not_run": f"its result has {times} verdicts instead of one",
        }


def test_pictures_and_facts_come_from_the_assets_own_page(project, digest_of_policy):
    store(project, "mujoco_validation", {"passed": True, "policy": digest_of_policy})
    metadata = {
        "survival of pushes": picture(PNG),
        "cells": 61,
        "suite": "full",
        "worst error": 0.04321,
        "dagster/uri": dg.MetadataValue.path("/somewhere"),
        "long": "x" * 200,
    }
    with dg.DagsterInstance.ephemeral() as instance:
        tags = {"dagster/data_version": "0123456789abcdef"}
        key = KNOWN["mujoco_validation"].key
        instance.report_runless_asset_event(dg.AssetMaterialization(key, metadata=metadata, tags=tags))
        dossier = gathered(project, instance)
    (shown,) = dossier.verdicts[0].pictures
    assert (shown.caption, shown.data, shown.kind) == ("survival of pushes", PNG, "png")
    (origin,) = [each for each in dossier.lineage if each.asset == "mujoco_validation"]
    assert origin.version == "0123456789ab"
    assert origin.facts == (("cells", "61"), ("suite", "full"), ("worst error", "0.04321"))


@pytest.mark.parametrize(
    ("version", "remark"), [("d1", ""), ("d2" * 32, "the policy was trained on another database: d1")]
)
def test_a_database_that_the_policy_was_not_trained_on_is_named(project, digest_of_policy, version, remark):
    with dg.DagsterInstance.ephemeral() as instance:
        tags = {"dagster/data_version": version}
        instance.report_runless_asset_event(dg.AssetMaterialization(KNOWN["expert_db"].key, tags=tags))
        dossier = gathered(project, instance)
    assert [each.remark for each in dossier.lineage if each.asset == "expert_db"] == [remark]


@dg.asset(key=KNOWN["mujoco_validation"].key)
def validation_that_crashes():
    raise ZeroDivisionError("no trial was left")


def test_a_check_that_crashed_is_not_reported_as_never_run(project, digest_of_policy):
    with dg.DagsterInstance.ephemeral() as instance:
        assert not dg.materialize([validation_that_crashes], instance=instance, raise_on_error=False).success
        verdict = gathered(project, instance).verdicts[0]
        assert verdict.status is Status.FAILED_TO_RUN
        (why,) = verdict.failed_to_run
        assert "failed: " in why and "no trial was left" in why
        store(project, "mujoco_validation", {"passed": True, "policy": digest_of_policy})
        later = gathered(project, instance).verdicts[0]
    assert later.status is Status.OUTDATED, "it passed once; its last run says nothing"
    assert "no trial was left" in later.reasons[0]


def test_a_check_whose_result_can_not_be_read_is_not_reported_as_never_run(project, digest_of_policy):
    path = project.store.manifest_path("mujoco_validation")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("{")
    with dg.DagsterInstance.ephemeral() as instance:
        dossier = gathered(project, instance)
    assert dossier.verdicts[0].status is Status.FAILED_TO_RUN
    (point,) = [each for each in dossier.open_points if each.startswith("mujoco_validation: ")]
    assert "not a readable manifest" in point


def test_walks_are_shown_moving_and_as_a_sheet(project, digest_of_policy):
    """A small network falls: the caption says so."""
    with dg.DagsterInstance.ephemeral() as instance:
        dossier = gathered(project, instance)
    assert [each.kind for each in dossier.pictures] == ["gif", "png", "gif", "png"]
    moving = [Image.open(io.BytesIO(each.data)) for each in dossier.pictures if each.kind == "gif"]
    assert all(image.n_frames > 5 and image.info["loop"] == 0 for image in moving), "they play, again and again"
    assert all("fell after" in each.caption for each in dossier.pictures)
    assert {each.caption.split(" in ")[0] for each in dossier.pictures} == {"forward 0.6 m/s", "forward 2 m/s"}


def test_a_walk_that_ends_at_once_is_shown_too(project, digest_of_policy, monkeypatch):
    """Of less than the half second that the sheet leaves out."""

    def deployed(folder, policy):
        one = deploy(folder, policy)
        walk = lambda plant, command, seconds, **others: one.walk(plant, command, 0.1, **others)  # noqa: E731
        return SimpleNamespace(robot=one.robot, walk=walk)

    deploy = release.deployed
    monkeypatch.setattr(release, "deployed", deployed)
    with dg.DagsterInstance.ephemeral() as instance:
        dossier = gathered(project, instance)
    assert [each.kind for each in dossier.pictures] == ["gif", "png", "gif", "png"]
