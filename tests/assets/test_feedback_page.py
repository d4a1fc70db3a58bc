"""The table of the page: each change with how many logs it rests on, and how often they count."""

from assets.feedback import FeedbackPage
from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.approved import Approvals
from tests.factories.trial_reports import failure, proposal, report

ONE, OTHER = "a" * 64, "b" * 64


def rests_on(*reports: TrialReport) -> dict[str, str]:
    """By part what its change rests on."""
    page = FeedbackPage(proposal=proposal(*reports), approvals=Approvals())
    rows = page.metadata("digest")["proposed changes"].records
    return {str(row.data["section"]): str(row.data["evidence"]) for row in rows}


def test_logs_of_one_policy_in_simulation_are_shown_with_how_often_they_count():
    """Three logs of a validation moved a weight by one step, and the page showed three logs."""
    simulated = [report(number, failure(), simulated=True, policy=ONE) for number in (1, 2, 3)]
    assert rests_on(*simulated)["weights"] == "3 logs that count as 1"
    assert (
        rests_on(*simulated, report(4, failure(), simulated=True, policy=OTHER))["weights"] == "4 logs that count as 2"
    )


def test_logs_of_a_robot_count_each():
    assert rests_on(report(1, failure()), report(2, failure()))["weights"] == "2 logs"
