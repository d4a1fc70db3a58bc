"""Approved seconds of a skill in KP1's result: more windows where the bound kept some out, else a sentence why not."""

import dataclasses
import html
import logging
import shutil
from functools import partial

import dagster as dg
import pytest

from assets import motions
from assets.approved import approved_part
from assets.database_checks import COVERED, _every_skill
from assets.plan import Plan
from assets.resources import ClipPoolResource
from pipeline.batch import ClipPool, Entry, Manifest, Stage, run_stage
from pipeline.feedback.approved import applied_versions, entries_of, part_version, write_entries
from pipeline.feedback.windows import BOUNDS, chosen_windows, unmet_requests
from pipeline.files import settings
from pipeline.project import Project
from pipeline.selection import Curation, process
from tests.factories.feedback_project import feedback_project
from tests.factories.human_clips import walker
from tests.factories.trial_reports import failure, proposal, report

AHEAD = (1.0, 0.0, 0.0)
FALL = report(1, failure(command=AHEAD), commands=((*AHEAD, 5.0),))
"""A log in which walking ahead fails: 1.2 times the seconds of `walk` are proposed."""
COUNT, EACH_S = 8, 2.0


@pytest.fixture
def project(root, tmp_path) -> Project:
    made = feedback_project(root, tmp_path)
    shutil.copy(root / "data/curation.yaml", made.settings("curation.yaml"))
    return made


def catalogue(project: Project) -> Manifest:
    """Files of one window each, all of them a walk."""
    entries = tuple(
        Entry(
            clip=f"mine/walk{place}",
            blob=project.store.put_clip(walker(f"mine/walk{place}", seconds=EACH_S)),
            numbers={"source": "mine", "file": f"walk{place}.bvh", "licence": "MIT", "seconds": EACH_S},
        )
        for place in range(COUNT)
    )
    return Manifest(stage="motion_catalog", entries=entries, judged=())


def approve(project: Project) -> None:
    write_entries(project.feedback.approved, entries_of(proposal(FALL).changes, "x", "a person"))


def bounded(project: Project, most_s: float) -> None:
    """The curation with another bound on walks."""
    path = project.settings("curation.yaml")
    text = path.read_text()
    assert "  walk: 2400\n" in text
    path.write_text(text.replace("  walk: 2400\n", f"  walk: {most_s}\n"))


@pytest.fixture
def asset(project, monkeypatch):
    """Runs `selected_motions` on the files of the project: the manifest and its page."""
    monkeypatch.setattr(motions, "PROJECT", project)
    files = catalogue(project)

    def run() -> tuple[Manifest, dict]:
        pool = ClipPoolResource(backend="sequential")
        result = motions.selected_motions(dg.build_asset_context(), clip_pool=pool, motion_catalog=files)
        assert isinstance(result, dg.MaterializeResult)
        return result.value, dict(result.metadata or {})

    return run


def taken_s(manifest: Manifest) -> float:
    return sum(entry.numbers["seconds"] for entry in manifest.entries)


def brought(manifest: Manifest) -> dict:
    """What the manifest says of the one bound that was raised."""
    ((bound,),) = [each["bounds"] for each in manifest.settings.values() if each.get("stage") == BOUNDS]
    return bound


def test_where_the_bound_kept_windows_out_more_are_taken_exactly_up_to_the_new_one(project, asset):
    bounded(project, 10.0)
    before, page = asset()
    assert taken_s(before) == pytest.approx(10.0) and "effect of feedback" not in page
    approve(project)
    after, page = asset()
    assert taken_s(after) == pytest.approx(12.0)
    assert {entry.clip for entry in before.entries} < {entry.clip for entry in after.entries}
    assert after.recomputed == 0, "windows are cut as they were, one more of them is taken"
    said = (
        "walk: feedback requests 12 s, 16.0 s are available: "
        "1 more window, from 10.0 s (limit 10 s) to 12.0 s, 4.0 s not selected"
    )
    assert html.unescape(page["effect of feedback"].value) == f"- {said}"
    assert page["windows not taken"] == 2
    bound = brought(after)
    assert bound["reached"] and bound["text"] == said and not unmet_requests(after.settings)


def test_where_the_bound_kept_none_out_the_same_windows_are_taken_and_that_is_said(project, asset):
    before, _ = asset()
    approve(project)
    after, page = asset()
    assert after.entries == before.entries and after.judged == before.judged
    assert after.recomputed == 0 and taken_s(after) == pytest.approx(COUNT * EACH_S)
    said = (
        "walk: feedback requests 2880 s, 16.0 s are available: "
        "no more windows, the limit of 2400 s excluded none; record more of this skill"
    )
    assert html.unescape(page["effect of feedback"].value) == f"- {said}"
    assert not brought(after)["reached"] and unmet_requests(after.settings) == (said,)


def test_a_stage_after_it_works_on_the_new_windows_alone(project):
    curation = settings.read(project.settings("curation.yaml"), Curation)
    pool, log = ClipPool(backend="sequential"), logging.getLogger("test")
    stage = Stage(
        name="cut", version="1", function=partial(process, settings=curation), settings=settings.plain(curation)
    )
    windows = run_stage(stage, catalogue(project), project.store, pool, log)
    approve(project)
    feedback = approved_part(project, "selection", None)

    def worked_on(bound_s: float) -> int:
        own = dataclasses.replace(curation, most_seconds={"walk": bound_s})
        after = dataclasses.replace(stage, name=f"next, bound {bound_s:g}")
        run_stage(after, chosen_windows(windows, own, ())[0], project.store, pool, log)
        return run_stage(after, chosen_windows(windows, own, feedback)[0], project.store, pool, log).recomputed

    assert worked_on(10.0) == 1
    assert worked_on(600.0) == 0


def test_taking_it_back_gives_the_same_bytes_as_before(project, asset):
    before, _ = asset()
    approve(project)
    assert asset()[0].to_text() != before.to_text()
    project.feedback.approved.unlink()
    assert asset()[0].to_text() == before.to_text()


def test_what_a_bound_brought_is_not_taken_for_an_approved_part(project, asset):
    approve(project)
    assert applied_versions(asset()[0].settings) == {
        "selection": part_version(approved_part(project, "selection", None))
    }


def test_the_check_of_the_database_tells_of_a_skill_that_feedback_wants_more_of(project, asset):
    plan = Plan("expert_db", "database", ())
    before, _ = asset()
    index = before.entry_table().assign(variant="original")
    assert "requested by feedback, not met" not in _every_skill(plan, index, before.settings).metadata
    approve(project)
    found = _every_skill(plan, index, asset()[0].settings)
    assert found.check_name == COVERED
    told = str(found.metadata["requested by feedback, not met"].value)
    assert told.startswith("walk: feedback requests 2880 s, 16.0 s are available")
