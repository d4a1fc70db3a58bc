"""What stages do with approved changes: nothing where there are none, and the logs behind them in their manifests."""

import dagster as dg

from assets.approved import PARTS, approved_changes, approved_key, approved_part, approved_versions, noting, told
from assets.bootstrap import _upstream
from assets.project import Project
from assets.variants import with_further_variants
from pipeline.batch import Entry, Judged, Manifest
from pipeline.feedback.approved import EMPTY, write_changes
from tests.factories.trial_reports import failure, proposal, report


def _manifest(*variants: str, clip: str = "walk") -> Manifest:
    entries = tuple(
        Entry(clip=f"{clip}{each}", blob="0", numbers={"seconds": 2.0, "skill": "walk"}) for each in ("", *variants)
    )
    row = Judged(
        clip=clip, pieces=tuple(each.clip for each in entries), reasons=(), numbers={"seconds_out": 2.0 * len(entries)}
    )
    return Manifest(stage="augmented_motions", entries=entries, judged=(row,), settings={"a": {"stage": "x"}})


def test_without_approvals_a_manifest_is_the_same_bytes():
    manifest = _manifest("~mirror")
    assert noting(manifest, (), "weights").to_text() == manifest.to_text()
    assert told(()) == {}


def test_without_a_file_every_part_is_empty_and_no_rules_are_read(tmp_path):
    (tmp_path / "robots/t1").mkdir(parents=True)
    (tmp_path / "robots/t1/robot.toml").write_text("")
    project = Project(tmp_path)
    assert approved_changes(project) == ()
    assert {version for version, _ in approved_versions(project).values()} == {EMPTY}
    assert len(approved_versions(project)) == len(PARTS)


def test_a_manifest_names_the_logs_of_what_took_effect(root, tmp_path):
    project = Project(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data/feedback_rules.yaml").write_text((root / "data/feedback_rules.yaml").read_text())
    write_changes(project.approved_feedback, proposal(report(1, failure())).changes, by="a person")
    part = approved_part(project, "weights", "t1")
    (stage,) = [each for each in noting(_manifest(), part, "weights").settings.values() if "changes" in each]
    assert stage["stage"] == "feedback on weights"
    assert stage["changes"][0]["witnesses"][0]["sha256"] == f"{1:064d}"
    assert "log001" not in _manifest().to_text()


def test_parts_of_another_robot_have_its_prefix_and_windows_are_all_robots():
    assert approved_key("weights", "k1") == dg.AssetKey(["k1", "approved_weights"])
    assert approved_key("weights", "t1") == dg.AssetKey(["approved_weights"])
    assert approved_key("selection", "k1") == dg.AssetKey(["approved_windows"])


def test_further_variants_join_those_that_are_there_and_no_clip_comes_twice():
    joined = with_further_variants(_manifest("~mirror"), _manifest("~mirror", "~x0.85", "~x1.15"))
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
    made = {key["database"], key["stage"], key["proposal"]}
    found = _upstream({key["database"]}, parents, made)
    assert key["approved"] in found and key["proposal"] not in found
