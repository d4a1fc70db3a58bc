"""Rules: what a failure moves and how far, which logs count, and that nothing passes its bound."""

import dataclasses

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.feedback.change import ChangeError, allowed_range, check_bounds
from pipeline.feedback.trust import is_demonstration, trusted
from tests.factories.trial_reports import LEFT_CELL, RULES, failure, proposal, report, saturated, values


def test_one_log_moves_a_weight_by_its_step_and_no_further():
    found = values(proposal(report(1, failure(), failure(time_s=5.0), failure("stumble"))))
    assert found[("weights", LEFT_CELL)] == RULES.weights.per_experiment
    assert found[("selection", "side_left")] == RULES.selection.per_experiment
    assert found[("augmentation", "time_scale of side_left")] == RULES.augmentation["time_scale"].first


def test_each_further_log_moves_it_on_up_to_the_bound():
    per_experiment, most = RULES.weights.per_experiment, RULES.weights.most
    for logs in (2, 3, 50):
        found = proposal(*(report(number, failure()) for number in range(logs)))
        assert values(found)[("weights", LEFT_CELL)] == pytest.approx(min(per_experiment**logs, most))
        assert all(change.value <= change.bound for change in found.changes)


def test_a_log_under_two_names_counts_once():
    one, other = report(1, failure()), report(2, failure())
    copied = dataclasses.replace(other, sha256=one.sha256)
    assert values(proposal(one, copied)) == values(proposal(one))


def test_all_trials_of_a_log_are_heard_and_count_as_one_log():
    fallen, sound = report(1, failure()), dataclasses.replace(report(1), trial="trial001+2")
    assert values(proposal(fallen, sound)) == values(proposal(fallen))
    again = dataclasses.replace(fallen, trial="trial001+2")
    assert values(proposal(fallen, again)) == values(proposal(fallen))


def test_every_change_names_the_logs_behind_it():
    found = proposal(report(1, failure()), report(2, failure()), report(3))
    (change,) = [each for each in found.changes if each.section == "weights"]
    assert [(each.log, each.sha256) for each in change.witnesses] == [
        ("log001.mcap", f"{1:064d}"),
        ("log002.mcap", f"{2:064d}"),
    ]
    assert "fall" in change.witnesses[0].said


def test_the_order_of_reports_does_not_matter():
    reports = [report(number, failure(), saturated(36.0 + 0.1 * number)) for number in range(4)]
    assert proposal(*reports) == proposal(*reversed(reports))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"policy": ""}, "it names no policy"),
        ({"integrity": "unverified"}, "no checksums"),
    ],
)
def test_a_log_that_cannot_be_trusted_proposes_nothing_and_is_told(changed, why):
    found = proposal(dataclasses.replace(report(1, failure()), **changed))
    assert found.changes == ()
    assert any(why in sentence for sentence in found.unproposed)


def test_simulated_logs_count_until_there_is_a_real_one_of_the_robot():
    simulated = report(1, failure(), simulated=True)
    assert values(proposal(simulated))
    found = proposal(simulated, report(2))
    assert found.changes == ()
    assert any("there are logs of a real t1" in sentence for sentence in found.unproposed)


@pytest.mark.parametrize("changed", [{"policy": ""}, {"integrity": "unverified"}, {"robot": "k1"}])
def test_a_real_log_that_cannot_count_silences_no_simulated_one(changed):
    simulated = report(1, failure(), simulated=True)
    found = proposal(simulated, dataclasses.replace(report(2, failure()), **changed))
    assert any(each.robot == "t1" and each.section == "weights" for each in found.changes)


def test_a_real_log_of_a_policy_whose_logs_do_not_count_silences_no_simulated_one():
    rules = dataclasses.replace(RULES, trust=dataclasses.replace(RULES.trust, policies=("a*",)))
    simulated, real = report(1, failure(), simulated=True), report(2, failure(), policy="b" * 64)
    assert [each.trial for each in trusted([simulated, real], rules)[0]] == [simulated.trial]
    assert [each.trial for each in trusted([simulated, real], RULES)[0]] == [real.trial]


def test_the_demonstration_counts_until_there_is_another_log_that_counts():
    shown = report(1, failure(), simulated=True, file="demo/fall")
    assert values(proposal(shown)) and all(is_demonstration(each) for each in proposal(shown).changes)
    assert values(proposal(shown, report(2, policy=""))), "a log that cannot count changes nothing"
    for own in (report(2, failure(), simulated=True), report(2, simulated=True)):
        found = proposal(shown, own)
        assert not any(is_demonstration(each) for each in found.changes)
        assert any("it is a demonstration log, and there are other logs" in each for each in found.unproposed)


def test_a_fall_that_only_the_robots_message_tells_moves_nothing():
    found = proposal(report(1, failure(evidence={"attitude": False})))
    assert found.changes == ()
    assert any("attitude does not confirm" in sentence for sentence in found.unproposed)


def test_what_happened_in_hands_or_after_a_stop_moves_nothing():
    assert proposal(report(1, failure(excuse="held by hand"), failure("held"), failure("stopped"))).changes == ()


def test_a_fall_under_an_unknown_command_belongs_to_no_cell():
    assert proposal(report(1, failure(), command_known=False)).changes == ()
    assert proposal(report(1, failure(command_known=False))).changes == ()


def test_an_unsure_failure_moves_nothing():
    assert proposal(report(1, failure(confidence=0.5))).changes == ()


def test_a_cell_that_is_walked_well_in_most_logs_is_left_alone():
    sound = [report(number) for number in range(2, 12)]
    assert ("weights", LEFT_CELL) not in values(proposal(report(1, failure()), *sound))


def test_a_motor_needs_two_logs_that_agree():
    alone = proposal(report(1, saturated(36.0)))
    assert "motors" not in {change.section for change in alone.changes}
    assert any("2 are required" in sentence for sentence in alone.unproposed)
    agreed = values(proposal(report(1, saturated(36.0)), report(2, saturated(36.4))))
    assert agreed[("motors", "Left_Knee_Pitch")] == pytest.approx(36.2)
    differing = proposal(report(1, saturated(30.0)), report(2, saturated(40.0)))
    assert "motors" not in {change.section for change in differing.changes}
    assert any("the logs differ" in sentence for sentence in differing.unproposed)


@pytest.mark.parametrize(("given_n_m", "why"), [(58.5, "less than 5 % below"), (10.0, "the motor is probably broken")])
def test_a_motor_keeps_its_limit_where_the_log_shows_about_that_or_a_fault(given_n_m, why):
    found = proposal(report(1, saturated(given_n_m)), report(2, saturated(given_n_m)))
    assert "motors" not in {change.section for change in found.changes}
    assert any(why in sentence for sentence in found.unproposed)


def test_pushes_widen_only_by_falls_that_a_push_was_seen_before():
    assert ("randomization", "push_speed") not in values(proposal(report(1, failure())))
    pushed = failure(evidence={"attitude": True, "cause": "push"})
    rule = RULES.randomization["push_speed"]
    assert values(proposal(report(1, pushed)))[("randomization", "push_speed")] == rule.start + rule.per_experiment


def test_low_friction_lowers_the_low_end_down_to_its_bound():
    slips = [report(number, failure("slip")) for number in range(20)]
    assert values(proposal(*slips))[("randomization", "friction")] == RULES.randomization["friction"].bound


@hypothesis.settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 6),
            st.sampled_from(["fall", "stumble", "slip", "tracking", "limit_cycle", "torque_saturation", "overheating"]),
            st.tuples(st.floats(-0.8, 2.2), st.floats(-0.8, 0.8), st.floats(-1.8, 1.8)),
            st.floats(5.0, 60.0),
        ),
        max_size=25,
    )
)
def test_whatever_is_in_the_logs_every_change_is_within_what_its_logs_allow(planted):
    logs: dict[int, list] = {}
    for number, kind, command, given_n_m in planted:
        evidence = {"attitude": True, "given_n_m": given_n_m, "limit_n_m": 60.0, "cause": "push"}
        one = failure(kind, command=command, joint="Left_Knee_Pitch", evidence=evidence)
        logs.setdefault(number, []).append(one)
    found = proposal(*(report(number, *failures) for number, failures in logs.items()))
    check_bounds(found.changes, RULES)
    for change in found.changes:
        low, high = allowed_range(change, RULES)
        assert low - 1e-9 <= change.value <= high + 1e-9


def test_a_change_beyond_what_its_logs_allow_is_refused():
    (change,) = [each for each in proposal(report(1, failure())).changes if each.section == "weights"]
    with pytest.raises(ChangeError, match=r"with 1 log, 1 to 1.25 is allowed"):
        check_bounds([dataclasses.replace(change, value=1.5)], RULES)
    with pytest.raises(ChangeError, match="names no log"):
        check_bounds([dataclasses.replace(change, witnesses=())], RULES)
    with pytest.raises(ChangeError, match="occurs twice"):
        check_bounds([change, change], RULES)
    with pytest.raises(ChangeError, match=r"has no rule in data/feedback_rules\.yaml"):
        check_bounds([dataclasses.replace(change, section="randomization", what="gravity")], RULES)
    with pytest.raises(ChangeError, match=r"has the value 0.001 before the change, but 0.3 by the rules"):
        wider = dataclasses.replace(change, section="randomization", what="friction", before=0.001, value=0.25)
        check_bounds([wider], RULES)


def test_a_change_that_rests_on_an_own_log_as_well_is_no_demonstration():
    (change, *_) = proposal(report(1, failure(), file="demo/fall")).changes
    (shown,) = change.witnesses
    own = dataclasses.replace(shown, log="field/fall.mcap")
    assert is_demonstration(change)
    for witnesses in ((shown, own), (own, shown), (own, own)):
        assert not is_demonstration(dataclasses.replace(change, witnesses=witnesses))
