"""An approval needs the token of the project's files; each counts once, and nothing that is shown holds a valid one."""

import dagster as dg
import pytest

import assets.approval
from assets.approval import TokenError, approve_feedback, ensure_token, take_back_feedback, use_token
from pipeline.project import Project
from tests.factories.feedback_project import feedback_project, propose_into, two_falls


@pytest.fixture
def project(root, tmp_path, monkeypatch) -> Project:
    made = feedback_project(root, tmp_path)
    monkeypatch.setattr(assets.approval, "PROJECT", made)
    monkeypatch.setattr(assets.approval, "note_external", lambda *_: {})
    return made


def token_of(project: Project) -> str:
    ensure_token(project)
    return project.approval_token.read_text().strip()


def launch(job: dg.JobDefinition, op: str, **config: object) -> str:
    """Launch a job as the web page does; what it failed with, or nothing."""
    done = job.execute_in_process(run_config={"ops": {op: {"config": config}}}, raise_on_error=False)
    failed = [event.step_failure_data.error for event in done.all_events if event.is_step_failure]
    return "" if done.success else str(failed[0].cause.message if failed[0].cause else failed[0].message)


def test_a_token_is_for_its_owner_alone_and_counts_once(project):
    token = token_of(project)
    assert len(token) == 32
    assert project.approval_token.stat().st_mode & 0o777 == 0o600
    use_token(project, f" {token}\n")
    assert token_of(project) != token
    with pytest.raises(TokenError, match="the token is not the one in data/feedback/approval_token"):
        use_token(project, token)


@pytest.mark.parametrize("token", ["", "0" * 32, "\u00e9", " "])
def test_another_token_approves_nothing_and_is_not_told_the_right_one(project, token):
    digest, right = propose_into(project, *two_falls()), token_of(project)
    said = launch(approve_feedback, "approve", proposal=digest, by="a page", token=token)
    assert "approval_token" in said and right not in said
    assert not project.feedback.approved.exists()
    assert token_of(project) == right


def test_without_a_token_file_one_is_made_and_asked_for(project):
    digest = propose_into(project, *two_falls())
    said = launch(approve_feedback, "approve", proposal=digest, by="a page", token="")
    assert "approval_token" in said
    assert project.approval_token.is_file()
    assert not project.feedback.approved.exists()


def test_with_the_token_a_proposal_is_approved_and_taken_back(project):
    digest = propose_into(project, *two_falls())
    token = token_of(project)
    assert launch(approve_feedback, "approve", proposal=digest, by="a person", token=token) == ""
    assert len(project.feedback.approvals().changes) == 5
    assert "approval_token" in launch(take_back_feedback, "take_back", sections=["motors"], by="a page", token=token)
    assert len(project.feedback.approvals().changes) == 5
    assert launch(take_back_feedback, "take_back", sections=["motors"], by="me", token=token_of(project)) == ""
    assert len(project.feedback.approvals().changes) == 4


def test_a_token_that_was_shown_in_a_failed_run_is_worth_nothing(project):
    propose_into(project, *two_falls())
    token = token_of(project)
    assert "is not pending" in launch(approve_feedback, "approve", proposal="beef", by="a person", token=token)
    assert token_of(project) != token
