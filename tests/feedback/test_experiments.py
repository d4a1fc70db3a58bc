"""What counts as one experiment: a log of the robot, and all of a policy's simulation, however many logs it wrote."""

import dataclasses

import pytest

from pipeline.failures.trial_report import TrialReport
from pipeline.feedback.approved import entries_of, read_approvals, write_entries
from pipeline.feedback.change import ChangeError, check_bounds
from tests.factories.trial_reports import LEFT_CELL, RULES, failure, proposal, report, saturated, values

SLIPPERY = dataclasses.replace(RULES.randomization["friction"], bound=0.05)
WIDE = dataclasses.replace(RULES, randomization={**RULES.randomization, "friction": SLIPPERY})
"""Rules with a bound that three experiments on friction do not reach."""
ALWAYS = dataclasses.replace(WIDE, trust=dataclasses.replace(RULES.trust, simulated="always"))
OTHER = "b" * 64
"""Digest of another policy."""
ONE_STEP = {
    ("weights", LEFT_CELL): RULES.weights.per_experiment,
    ("selection", "side_left"): RULES.selection.per_experiment,
    ("augmentation", "time_scale of side_left"): RULES.augmentation["time_scale"].first,
    ("augmentation", "step_width of side_left"): RULES.augmentation["step_width"].first,
    ("augmentation", "step_length of side_left"): 1.0 - RULES.augmentation["step_length"].first,
    ("randomization", "friction"): 0.25,
    ("randomization", "gain_range"): 0.85,
    ("randomization", "push_speed"): 1.55,
}
"""What one experiment in which all of this fails moves."""


def simulated(number: int, *failures, **more) -> TrialReport:
    """The log of a cell that a policy failed in simulation."""
    return report(number, *failures, simulated=True, **more)


def cells(count: int, *, first: int = 0, **more) -> list[TrialReport]:
    """The logs of a validation that fails in this many cells, each in all of these ways."""
    pushed = failure(direction="left", evidence={"attitude": True, "cause": "push"})
    return [
        simulated(first + number, pushed, failure("slip"), failure("tracking", direction="lateral"), **more)
        for number in range(count)
    ]


@pytest.mark.parametrize("count", [1, 2, 28])
def test_a_validation_moves_each_number_by_one_step_however_many_cells_fail(count):
    found = proposal(*cells(count))
    assert values(found) == pytest.approx(ONE_STEP)
    assert {len(each.logs) for each in found.changes} == {count}, "all of them are named"


def test_another_validation_of_the_same_policy_moves_nothing_further():
    again = cells(28, first=100)
    assert values(proposal(*cells(28), *again)) == values(proposal(*cells(28)))
    assert values(proposal(*cells(3), *again)) == values(proposal(*again))


def test_another_policy_in_simulation_is_another_experiment():
    found = values(proposal(*cells(28), *cells(28, first=100, policy=OTHER), rules=WIDE))
    assert found["randomization", "friction"] == pytest.approx(0.2)
    assert found["weights", LEFT_CELL] == RULES.weights.per_experiment**2


def test_each_log_of_the_robot_counts_and_simulation_beside_it_once():
    real = [report(200 + number, failure("slip")) for number in range(2)]
    found = values(proposal(*real, *cells(28), rules=ALWAYS))
    assert values(proposal(*real, rules=WIDE))["randomization", "friction"] == pytest.approx(0.2)
    assert found["randomization", "friction"] == pytest.approx(0.15)


def test_many_simulated_failures_do_not_outvote_what_the_robot_walked_well():
    sound = [report(200 + number) for number in range(5)]
    assert ("weights", LEFT_CELL) not in values(proposal(*cells(28), *sound, rules=ALWAYS))
    assert ("weights", LEFT_CELL) in values(proposal(*cells(28), *sound[:4], rules=ALWAYS))


def test_of_simulated_logs_of_one_policy_enough_must_fail():
    sound = [simulated(200 + number) for number in range(12)]
    assert ("weights", LEFT_CELL) not in values(proposal(*cells(2), *sound))
    assert ("weights", LEFT_CELL) in values(proposal(*cells(3), *sound))


def test_a_motor_is_measured_by_logs_and_no_further_one_moves_it_on():
    weak = [simulated(number, saturated(36.0)) for number in range(10)]
    assert not [each for each in proposal(weak[0]).changes if each.section == "motors"]
    for logs in (weak[:2], weak):
        (change,) = [each for each in proposal(*logs).changes if each.section == "motors"]
        assert change.value == 36.0 and "count" not in change.text()


def test_a_change_says_how_many_logs_it_has_and_how_often_they_count():
    (change,) = [each for each in proposal(*cells(28)).changes if each.what == "friction"]
    assert change.text().endswith("by 28 logs that count as 1 (simulated)")
    (change,) = [each for each in proposal(report(1, failure("slip"))).changes if each.what == "friction"]
    assert change.text().endswith("by 1 log")


def test_what_one_experiment_does_not_allow_is_refused_whoever_wrote_the_file(tmp_path):
    changes = proposal(*cells(28)).changes
    further = tuple(dataclasses.replace(each, value=0.2) for each in changes if each.what == "friction")
    with pytest.raises(
        ChangeError, match=r"'friction' is 0\.2; with 28 logs that count as 1, 0\.25 to 0\.3 is allowed"
    ):
        check_bounds(further, RULES)
    write_entries(tmp_path / "approved.yaml", entries_of(further, "x", "a person"))
    assert list(read_approvals(tmp_path / "approved.yaml", RULES).faults) == ["randomization"]


def test_equal_logs_in_any_order_make_the_same_file(tmp_path):
    logs = [*cells(28), *cells(5, first=100, policy=OTHER), simulated(200)]
    for name, reports in (("one", logs), ("other", logs[::-1])):
        changes = proposal(*reports).changes
        write_entries(tmp_path / name, entries_of(changes, "x"), head="proposed")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
