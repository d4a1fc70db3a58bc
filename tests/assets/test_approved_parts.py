"""What stages do with approved changes: nothing where there are none, and the logs behind them in their manifests."""

import dataclasses
import shutil

import dagster as dg
import pytest

from assets import actuators
from assets.approved import (
    BROKEN,
    PARTS,
    approval_metadata,
    approved_key,
    approved_part,
    approved_versions,
)
from assets.bootstrap import hard_inputs, upstream
from assets.plan import Plan, robot_plans
from assets.reference_motions import with_further_variants
from pipeline.batch import Entry, Judged, Manifest
from pipeline.errors import SettingsError
from pipeline.feedback.approved import EMPTY, entries_of, with_applied_changes, write_entries
from pipeline.project import Project
from tests.factories.feedback_project import feedback_project
from tests.factories.trial_reports import failure, proposal, report, saturated


def _manifest(*variants: str, clip: str = "walk") -> Manifest:
    entries = tuple(
        Entry(clip=f"{clip}{each}", blob="0", numbers={"seconds": 2.0, "skill": "walk"}) for each in ("", *variants)
    )
    row = Judged(
        clip=clip, pieces=tuple(each.clip for each in entries), reasons=(), numbers={"seconds_out": 2.0 * len(entries)}
    )
    return Manifest(stage="motion_variants", entries=entries, judged=(row,), settings={"a": {"stage": "x"}})


def test_without_approvals_a_manifest_is_the_same_bytes():
    manifest = _manifest("~mirror")
    assert with_applied_changes(manifest, (), "weights").to_text() == manifest.to_text()
    assert approval_metadata(()) == {}


def test_without_a_file_every_part_is_empty_and_no_rules_are_read(tmp_path):
    (tmp_path / "robots/t1").mkdir(parents=True)
    (tmp_path / "robots/t1/robot.toml").write_text("")
    project = Project(tmp_path)
    assert project.feedback.approvals().changes == ()
    assert {version for version, _ in approved_versions(project).values()} == {EMPTY}
    assert len(approved_versions(project)) == len(PARTS)


def test_a_manifest_names_the_logs_of_what_took_effect(root, tmp_path):
    project = feedback_project(root, tmp_path)
    write_entries(project.feedback.approved, entries_of(proposal(report(1, failure())).changes, "x", "a person"))
    part = approved_part(project, "weights", "t1")
    (stage,) = [
        each for each in with_applied_changes(_manifest(), part, "weights").settings.values() if "changes" in each
    ]
    assert stage["stage"] == "feedback on weights"
    assert stage["changes"][0]["witnesses"][0]["sha256"] == f"{1:064d}"
    assert "log001" not in _manifest().to_text()


def test_a_section_that_cannot_be_used_has_a_version_of_its_own_and_stops_nothing_else(root, tmp_path):
    project = feedback_project(root, tmp_path)
    write_entries(project.feedback.approved, entries_of(proposal(report(1, failure())).changes, "x", "a person"))
    sound = approved_versions(project)
    text = project.feedback.approved.read_text()
    project.feedback.approved.write_text(text.replace("value: 1.25", "value: 1.2"))
    broken = approved_versions(project)
    changed = {key.to_user_string() for key in sound if sound[key][0] != broken[key][0]}
    assert changed == {"approved_weights"}
    version, facts = broken[dg.AssetKey(["approved_weights"])]
    assert version.startswith(BROKEN) and "revoke it" in facts["can't be used"]
    with pytest.raises(SettingsError, match=r"approved.yaml: approvals\[2\], 'weights'"):
        approved_part(project, "weights", "t1")
    assert approved_part(project, "augmentation", "t1")


def test_rules_that_cannot_be_read_fault_what_is_approved_by_their_name(root, tmp_path):
    project = feedback_project(root, tmp_path)
    write_entries(project.feedback.approved, entries_of(proposal(report(1, failure())).changes, "x", "a person"))
    project.settings("feedback_rules.yaml").write_text("approval: 3\n")
    assert all(version.startswith(BROKEN) for version, _ in approved_versions(project).values())
    with pytest.raises(SettingsError, match=r"feedback_rules.yaml: .*'approval' is 3"):
        approved_part(project, "motors", "t1")


@pytest.mark.parametrize(
    ("written", "says"),
    [
        (
            {"value": 1.5, "before": 5.0},
            "'Left_Knee_Pitch' is 1.5 N m; the lowest allowed is 0.3 of the calibrated 60 N m",
        ),
        ({"what": "No_Such_Joint"}, "'No_Such_Joint' is no joint of t1"),
    ],
)
def test_a_limit_written_by_hand_is_held_against_the_calibrated_one(root, tmp_path, monkeypatch, written, says):
    project = feedback_project(root, tmp_path)
    shutil.copy(root / "data/actuators.yaml", project.data)
    shutil.copytree(root / "robots/t1", project.robot_folder("t1"), dirs_exist_ok=True)
    changes = proposal(*(report(number, saturated(36.0)) for number in range(2))).changes
    motors = [dataclasses.replace(each, **written) for each in changes if each.section == "motors"]
    write_entries(project.feedback.approved, entries_of(motors, "x", "a person"))
    assert len(approved_part(project, "motors", "t1")) == 1, "the rules alone can't tell"
    monkeypatch.setattr(actuators, "PROJECT", project)
    asset = actuators.adapted_robot(robot_plans("t1")["adapted_robot"])
    nothing = Manifest(stage="actuator_calibration", entries=(), judged=(), settings={})
    with pytest.raises(dg.DagsterUserCodeExecutionError, match=says):
        asset(actuator_calibration=nothing, robot_model=nothing)
    assert not project.adapted_robot("t1").exists()


def test_parts_of_another_robot_have_its_prefix_and_windows_are_all_robots():
    assert approved_key("weights", "k1") == dg.AssetKey(["k1", "approved_weights"])
    assert approved_key("weights", "t1") == dg.AssetKey(["approved_weights"])
    assert approved_key("selection", "k1") == dg.AssetKey(["approved_windows"])


def test_further_variants_join_those_that_are_there_and_no_clip_comes_twice():
    joined = with_further_variants(_manifest("~mirror"), _manifest("~mirror", "~x0.85", "~x1.15"), "walk")
    assert [each.clip for each in joined.entries] == ["walk", "walk~mirror", "walk~x0.85", "walk~x1.15"]
    (row,) = joined.judged
    assert row.pieces == ("walk", "walk~mirror", "walk~x0.85", "walk~x1.15")
    assert row.numbers["seconds_out"] == 8.0


def test_what_a_database_needs_ends_at_what_comes_from_outside():
    key = {name: dg.AssetKey([name]) for name in ("logs", "proposal", "approved", "stage", "database")}
    parents = {
        key["database"]: {key["stage"]},
        key["stage"]: {key["approved"]},
        key["approved"]: {key["proposal"]},
        key["proposal"]: {key["logs"]},
    }
    plans = {key[name]: Plan(name, "group", ()) for name in ("database", "stage", "proposal")}
    found = upstream({key["database"]}, hard_inputs(parents, plans))
    assert key["approved"] in found and key["proposal"] not in found
