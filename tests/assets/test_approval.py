"""Approving: a proposal by its digest, sections that add up, and taking back, which never happens by the way."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import pytest

from assets.approved import PARTS, approved_part
from assets.feedback import FeedbackPage
from pipeline.errors import PipelineError
from pipeline.feedback.approve import ApprovalError, approve_proposal, decline_proposal, take_back_sections
from pipeline.feedback.approved import entries_of, write_entries
from pipeline.project import Project
from tests.factories.feedback_project import feedback_project, propose_into, two_falls
from tests.factories.trial_reports import failure, proposal, report

OTHER = "b" * 64
"""Another policy."""


@pytest.fixture
def project(root, tmp_path) -> Project:
    return feedback_project(root, tmp_path)


def sections(project: Project) -> set[str]:
    return {change.section for change in project.feedback.approvals().changes}


def test_what_was_looked_at_is_what_is_approved(project):
    digest = propose_into(project, *two_falls())
    count = approve_proposal(project.feedback, digest, "a person")
    approvals = project.feedback.approvals()
    assert len(approvals.changes) == count == 5
    assert sections(project) == set(PARTS)
    assert {(entry.proposal, entry.by) for entry in approvals.entries} == {(digest, "a person")}


def test_another_digest_approves_nothing(project):
    digest = propose_into(project, *two_falls())
    with pytest.raises(ApprovalError, match="proposal 'beef' is not pending"):
        approve_proposal(project.feedback, "beef", "a person")
    with pytest.raises(ApprovalError, match="an approval needs a name"):
        approve_proposal(project.feedback, digest, " ")
    with pytest.raises(ApprovalError, match="nothing was approved"):
        approve_proposal(project.feedback, digest, "a person", policies=(OTHER,))
    with pytest.raises(ApprovalError, match=r"there is no section 'wights'; sections are: .*weights"):
        approve_proposal(project.feedback, digest, "a person", sections=("wights", "weights"))
    assert not project.feedback.approved.exists()


def test_approvals_of_sections_add_up_each_from_its_own_proposal(project):
    first = propose_into(project, report(1, failure()))
    approve_proposal(project.feedback, first, "one", sections=("weights",))
    weights = approved_part(project, "weights", "t1")
    second = propose_into(project, *two_falls())
    approve_proposal(project.feedback, second, "another", sections=("motors",))
    assert approved_part(project, "weights", "t1") == weights, "as it was approved, though more is proposed now"
    approve_proposal(project.feedback, second, "another", sections=("selection", "augmentation"))
    by = {entry.section: (entry.proposal, entry.by) for entry in project.feedback.approvals().entries}
    assert by == {"weights": (first, "one")} | dict.fromkeys(
        ("selection", "augmentation", "motors"), (second, "another")
    )
    approve_proposal(project.feedback, second, "another", sections=("weights",))
    (change,) = approved_part(project, "weights", "t1")
    assert change.value == 1.5625, "the section's last approval counts"


def test_a_proposal_that_has_nothing_of_a_section_leaves_what_was_approved_of_it(project):
    approve_proposal(project.feedback, propose_into(project, *two_falls()), "a person")
    approve_proposal(project.feedback, propose_into(project, report(7, failure())), "a person")
    assert sections(project) == set(PARTS), "motors and ranges are not proposed any more, but nobody took them back"
    (change,) = approved_part(project, "weights", "t1")
    assert change.value == 1.25


def test_approvals_of_policies_add_up_within_a_section(project):
    forward = failure(command=(0.8, 0.0, 0.0))
    digest = propose_into(
        project, report(1, failure()), report(2, forward, policy=OTHER, commands=((0.8, 0.0, 0.0, 5.0),))
    )
    approve_proposal(project.feedback, digest, "a person", policies=("a" * 64,), sections=("weights",))
    (left,) = approved_part(project, "weights", "t1")
    approve_proposal(project.feedback, digest, "a person", policies=(OTHER,), sections=("weights",))
    part = approved_part(project, "weights", "t1")
    assert len(part) == 2 and left in part


def test_playing_speeds_approved_by_the_skill_alone_give_way_to_the_same_under_their_full_name(project):
    changes = proposal(report(1, failure())).changes
    speeds = next(each for each in changes if each.what == "time_scale of side_left")
    old = dataclasses.replace(speeds, what="side_left")
    write_entries(project.feedback.approved, entries_of([old], "x", "one"))
    assert approved_part(project, "augmentation", "t1") == (old,)
    digest = propose_into(project, report(1, failure()))
    approve_proposal(project.feedback, digest, "another", policies=("a" * 64,), sections=("augmentation",))
    assert speeds in approved_part(project, "augmentation", "t1") and not project.feedback.approvals().faults


def test_nothing_is_written_that_could_not_be_read_again(project, monkeypatch):
    digest = propose_into(project, report(1, failure()))
    approve_proposal(project.feedback, digest, "a person")
    before = project.feedback.approved.read_text()
    monkeypatch.setattr("pipeline.feedback.approve.merged", lambda earlier, new, whole: (*earlier, *new))
    with pytest.raises(PipelineError, match="occurs twice"):
        approve_proposal(project.feedback, digest, "another")
    assert project.feedback.approved.read_text() == before


def test_sections_are_taken_back_by_name_alone(project):
    approve_proposal(project.feedback, propose_into(project, *two_falls()), "a person")
    assert take_back_sections(project.feedback, ("motors", "weights"), "a person") == 2
    assert sections(project) == set(PARTS) - {"motors", "weights"}
    with pytest.raises(ApprovalError, match="nothing of 'motors' is approved; approved are: augmentation, rand"):
        take_back_sections(project.feedback, ("motors",), "a person")
    with pytest.raises(ApprovalError, match="no section is named"):
        take_back_sections(project.feedback, (), "a person")
    with pytest.raises(ApprovalError, match="needs a name"):
        take_back_sections(project.feedback, ("selection",), "")
    take_back_sections(project.feedback, tuple(sections(project)), "a person")
    assert not project.feedback.approved.exists()


def test_a_section_edited_by_hand_is_mended_by_approving_or_taking_it_back(project):
    digest = propose_into(project, *two_falls())
    approve_proposal(project.feedback, digest, "a person")
    path = project.feedback.approved
    edited = path.read_text().replace("value: 1.5625", "value: 1.5")
    path.write_text(edited)
    with pytest.raises(PipelineError, match=r"'weights': its changes do not have the digest.*approve 'weights' of"):
        approved_part(project, "weights", "t1")
    assert approved_part(project, "motors", "t1"), "the other sections are as they were"
    with pytest.raises(
        ApprovalError, match="nothing was approved, since the approved changes of 'weights' can't be read"
    ):
        approve_proposal(project.feedback, digest, "a person", policies=("a" * 64,))
    take_back_sections(project.feedback, ("weights",), "a person")
    assert not project.feedback.approvals().faults
    path.write_text(edited)
    approve_proposal(project.feedback, digest, "a person", sections=("motors",))
    assert set(project.feedback.approvals().faults) == {"weights"}, "approving another section hides nothing"
    approve_proposal(project.feedback, digest, "a person", sections=("weights",))
    assert not project.feedback.approvals().faults


def test_nothing_is_written_over_a_file_that_cannot_be_read(project):
    digest = propose_into(project, *two_falls())
    path = project.feedback.approved
    path.parent.mkdir(exist_ok=True)
    path.write_text("approvals: [\n")
    for act in (
        lambda: approve_proposal(project.feedback, digest, "a person"),
        lambda: take_back_sections(project.feedback, ("weights",), "a person"),
    ):
        with pytest.raises(ApprovalError, match=r"approved.yaml, line 2: .*Mend it, or delete it and approve again"):
            act()
    assert path.read_text() == "approvals: [\n"


def test_what_was_declined_is_not_asked_again_until_its_evidence_changes(project):
    digest = propose_into(project, report(1, failure()))
    with pytest.raises(ApprovalError, match="needs a name"):
        decline_proposal(project.feedback, digest, " ")
    decline_proposal(project.feedback, digest, "a person", sections=("weights",))
    page = page_of(project, proposal(report(1, failure())))
    assert {change.section for change in page.declined} == {"weights"}
    assert "weights" not in {change.section for change in page.pending}
    assert project.feedback.approvals().changes == ()
    again = proposal(report(1, failure()), report(2, failure()))
    page = page_of(project, again)
    assert "weights" in {change.section for change in page.pending}, "another log is other evidence"


def test_declining_overwrites_no_file_that_can_not_be_read(project):
    digest = propose_into(project, report(1, failure()))
    decline_proposal(project.feedback, digest, "a person", sections=("weights",))
    project.feedback.declined.write_text("approvals: [\n")
    with pytest.raises(ApprovalError, match=r"nothing was declined, .*declined.yaml, line 2: .*and decline again"):
        decline_proposal(project.feedback, digest, "a person")
    assert project.feedback.declined.read_text() == "approvals: [\n"


def page_of(project, made) -> FeedbackPage:
    declined = project.feedback.declined_changes()
    return FeedbackPage(proposal=made, approvals=project.feedback.approvals(), declined_changes=declined)


def test_approving_what_was_declined_lets_it_take_effect(project):
    digest = propose_into(project, report(1, failure()))
    decline_proposal(project.feedback, digest, "a person")
    approve_proposal(project.feedback, digest, "another", sections=("weights",))
    page = page_of(project, proposal(report(1, failure())))
    assert "weights" not in {change.section for change in page.declined}


def test_answers_at_the_same_time_are_all_kept(project):
    digest = propose_into(project, *two_falls())
    for _ in range(10):
        with ThreadPoolExecutor(len(PARTS)) as pool:
            list(pool.map(lambda part: approve_proposal(project.feedback, digest, "me", sections=(part,)), PARTS))
        assert sections(project) == set(PARTS)
        project.feedback.approved.unlink()
