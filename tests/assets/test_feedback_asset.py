"""The page of curation_feedback: what waits, what is only shown, what can't be used; and rules that ask no person."""

import shutil

import dagster as dg
import pytest

from assets import feedback
from assets.sensors import MAX_FAILURES, page_request, renew_feedback_page
from pipeline.batch import Manifest
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.approve import approve_proposal, take_back_sections
from pipeline.feedback.approved import entries_of, write_entries
from pipeline.files import settings
from pipeline.project import Project
from tests.factories.trial_reports import failure, proposal, report, saturated

NOBODY = ("required: true", "required: false")


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Project:
    """A project of settings alone."""
    (tmp_path / "data").mkdir()
    for path in (root / "data").glob("*.yaml"):
        shutil.copy(path, tmp_path / "data")
    (tmp_path / "robots/t1").mkdir(parents=True)
    (tmp_path / "robots/t1/robot.toml").write_text("")
    made = Project(tmp_path)
    monkeypatch.setattr(feedback, "PROJECT", made)
    return made


def without_a_person(project: Project) -> None:
    path = project.settings("feedback_rules.yaml")
    path.write_text(path.read_text().replace(*NOBODY))


def page(project: Project, *reports: TrialReport) -> tuple[dict, dg.AssetCheckResult]:
    """What the asset's page says of reports, and its check."""
    stored = {each.trial: {"report": settings.plain(each)} for each in reports}
    failures = Manifest(stage="failure_modes", entries=(), judged=(), settings=stored)
    result = made_of(failures)
    project.store.save("curation_feedback", result.value)
    (check,) = result.check_results
    plain = {key: getattr(value, "md_str", value) for key, value in result.metadata.items()}
    return plain, check


def made_of(failures: Manifest) -> dg.MaterializeResult:
    result = feedback.curation_feedback(dg.build_asset_context(), failure_modes=failures)
    assert isinstance(result, dg.MaterializeResult)
    return result


def note_page(instance: dg.DagsterInstance, *reports: TrialReport) -> dict:
    """Make the page and note it in the history; its rows."""
    stored = {each.trial: {"report": settings.plain(each)} for each in reports}
    result = made_of(Manifest(stage="failure_modes", entries=(), judged=(), settings=stored))
    instance.report_runless_asset_event(dg.AssetMaterialization(dg.AssetKey(["curation_feedback"]), tags=result.tags))
    return dict(result.metadata or {})


def fall(number: int, **more) -> TrialReport:
    return report(number, failure(), **more)


def found(check: dg.AssetCheckResult) -> str:
    return str(check.metadata["found"].value)


def test_what_is_proposed_waits_until_it_is_approved(project):
    said, check = page(project, fall(1))
    assert not check.passed and check.severity == dg.AssetCheckSeverity.WARN
    assert said["changes pending"] == 3 and found(check) == "3 changes wait for approval"
    assert said["proposal"] in said["how to approve"]
    approve_proposal(project.feedback, said["proposal"], "a person", sections=("weights",))
    said, check = page(project, fall(1))
    assert (said["changes pending"], said["changes approved"], check.passed) == (2, 1, False)
    approve_proposal(project.feedback, said["proposal"], "a person")
    said, check = page(project, fall(1))
    assert check.passed and said["how to approve"] == "nothing waits for approval"


def test_the_page_is_made_anew_after_every_approval_and_taking_back(project):
    digest = page(project, fall(1))[0]["proposal"]
    with dg.DagsterInstance.ephemeral() as instance:
        assert page_request(instance, project) is None, "there is no page yet, as no log was dropped"
        note_page(instance, fall(1))
        for act, pending in (
            (lambda: approve_proposal(project.feedback, digest, "a person", sections=("weights",)), 2),
            (lambda: shutil.copy(project.proposed_feedback, project.feedback.approved), 0),
            (lambda: take_back_sections(project.feedback, ("weights", "selection"), "a person"), 2),
            (lambda: project.feedback.approved.write_text("approvals: 3\n"), 3),
            (lambda: project.feedback.approved.unlink(), 3),
        ):
            assert page_request(instance, project) is None
            act()
            request = page_request(instance, project)
            assert request is not None and request.job_name == renew_feedback_page.name
            assert note_page(instance, fall(1))["changes pending"] == pending


def test_a_page_that_cannot_be_made_is_tried_a_few_times_and_no_more(project):
    from assets.definitions import defs

    job = defs.resolve_job_def(renew_feedback_page.name)
    digest = page(project, fall(1))[0]["proposal"]
    with dg.DagsterInstance.ephemeral() as instance:
        note_page(instance, fall(1))
        approve_proposal(project.feedback, digest, "a person")
        for _ in range(MAX_FAILURES):
            request = page_request(instance, project)
            assert request is not None
            run = instance.create_run_for_job(job, tags=dict(request.tags), status=dg.DagsterRunStatus.STARTED)
            assert page_request(instance, project) is None, "it is at work"
            instance.report_run_failed(run)
        assert page_request(instance, project) is None


def test_copying_the_proposal_approves_it(project):
    page(project, fall(1))
    shutil.copy(project.proposed_feedback, project.feedback.approved)
    assert page(project, fall(1))[1].passed


def test_what_is_approved_and_proposed_no_longer_is_told_and_stays(project):
    said, _ = page(project, fall(1))
    approve_proposal(project.feedback, said["proposal"], "a person")
    said, check = page(project)
    assert said["proposal"] == "none" and check.passed
    assert said["approved, no longer proposed"].count("t1, ") == 3
    assert len(project.feedback.approvals().changes) == 3


@pytest.mark.parametrize("text", ["approvals: 3\n", "approvals: [", "proposal: x\nchanges: []\n"])
def test_a_broken_file_of_approvals_is_told_on_the_page_and_hides_no_proposal(project, text):
    project.feedback.approved.parent.mkdir(exist_ok=True)
    project.feedback.approved.write_text(text)
    said, check = page(project, fall(1))
    assert said["changes pending"] == 3 and not check.passed
    assert said["invalid approved changes"] == found(check)
    assert "approved.yaml" in found(check) and "Mend it, or delete it and approve again" in found(check)
    assert project.feedback.approved.read_text() == text


def test_a_broken_section_is_told_on_the_page(project):
    changes = proposal(fall(1)).changes
    write_entries(project.feedback.approved, entries_of(changes, "x", "a person"))
    text = project.feedback.approved.read_text()
    project.feedback.approved.write_text(text.replace("value: 1.25", "value: 1.2"))
    said, check = page(project, fall(1))
    assert said["changes approved"] == 2 and not check.passed
    assert "approve 'weights' of the current proposal again" in found(check)


def test_the_demonstration_is_proposed_and_nobody_is_called_for_it(project):
    said, check = page(project, fall(1, simulated=True, file="demo/side_left_fall"))
    assert said["changes pending"] == 3 and said["proposal"] in said["how to approve"]
    assert check.passed and "no change from your own logs is pending" in found(check)
    assert "ship to demonstrate the loop" in said["demonstration"]
    said, check = page(project, fall(1, simulated=True, file="demo/side_left_fall"), fall(2, simulated=True))
    assert not check.passed and "demonstration" not in said


def test_without_a_person_what_is_proposed_is_what_is_approved_no_more_and_no_less(project):
    without_a_person(project)
    both = [report(number, failure(), saturated(36.0)) for number in range(2)]
    assert page(project, *both)[1].passed
    assert len(project.feedback.approvals().changes) == 5
    assert page(project, fall(1))[1].passed
    assert {each.section for each in project.feedback.approvals().changes} == {"selection", "augmentation", "weights"}
    said, check = page(project)
    assert check.passed and said["changes approved"] == 0
    assert not project.feedback.approved.exists(), "an empty proposal takes everything back"


def test_without_a_person_what_one_approved_before_goes_with_its_proposal(project):
    said, _ = page(project, fall(1))
    approve_proposal(project.feedback, said["proposal"], "a person")
    without_a_person(project)
    page(project)
    assert not project.feedback.approved.exists()


def test_without_a_person_the_demonstration_takes_no_effect_unless_one_approves_it(project):
    without_a_person(project)
    shown = fall(1, simulated=True, file="demo/side_left_fall")
    said, _ = page(project, shown)
    assert not project.feedback.approved.exists()
    approve_proposal(project.feedback, said["proposal"], "a person")
    page(project, shown)
    assert len(project.feedback.approvals().changes) == 3
    page(project, shown, fall(2))
    assert {one.log for each in project.feedback.approvals().changes for one in each.witnesses} == {"log002.mcap"}


def test_without_a_person_a_broken_file_is_written_anew(project):
    without_a_person(project)
    project.feedback.approved.parent.mkdir(exist_ok=True)
    project.feedback.approved.write_text("approvals: 3\n")
    assert page(project, fall(1))[1].passed
    assert len(project.feedback.approvals().changes) == 3


def test_a_trial_beside_its_simulation_has_units(project):
    velocities = {"command": [0.6, 0.0, 0.1], "achieved": [0.5, 0.0, 0.1], "simulated": [0.55, 0.0, 0.1]}
    twin = {"start_s": 1.0, "stop_s": 9.0, "simulation_fell": False, "cycles": [], "notes": [], **velocities}
    found = Manifest(stage="failure_modes", entries=(), judged=(), settings={"walk": {"twin": twin}})
    (row,) = feedback.sim_to_real_report(found).metadata["trials and their simulation"].records
    assert row.data["forward achieved [m/s]"] == "0.5"
    assert row.data["yaw commanded [rad/s]"] == "0.1"
