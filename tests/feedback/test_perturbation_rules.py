"""Perturbations by failures: which kind answers which, to which side, how far, and what the rules may say."""

import dataclasses

import pytest

from pipeline.errors import SettingsError
from pipeline.feedback.change import ChangeError, allowed_range, check_bounds
from pipeline.feedback.rules import FeedbackRules
from pipeline.files import settings
from tests.factories.trial_reports import DATA, RULES, failure, proposal, report, values

ANSWERED = [
    ("stumble", "", "foot_lift", 0.02),
    ("slip", "", "step_length", 0.9),
    ("fall", "left", "step_width", 0.02),
    ("fall", "right", "step_width", 0.02),
    ("fall", "forward", "trunk_lean", -2.0),
    ("fall", "backward", "trunk_lean", 2.0),
]


def perturbed(*reports) -> dict[str, float]:
    """What the reports propose for KP4."""
    return {what: value for (section, what), value in values(proposal(*reports)).items() if section == "augmentation"}


@pytest.mark.parametrize(("kind", "direction", "perturbation", "first"), ANSWERED)
def test_each_failure_is_answered_by_its_kind_for_its_skill_alone(kind, direction, perturbation, first):
    found = perturbed(report(1, failure(kind, direction=direction)))
    if kind in ("fall", "stumble"):
        assert found.pop("time_scale of side_left") == RULES.augmentation["time_scale"].first
    assert found == {f"{perturbation} of side_left": first}


@pytest.mark.parametrize(("kind", "direction", "perturbation", "first"), ANSWERED)
def test_each_further_log_goes_on_to_that_side_up_to_the_bound(kind, direction, perturbation, first):
    rule, what = RULES.augmentation[perturbation], f"{perturbation} of side_left"
    without = 1.0 if perturbation == "step_length" else 0.0
    sign = 1.0 if first > without else -1.0
    for logs in (2, 9):
        found = proposal(*(report(number, failure(kind, direction=direction)) for number in range(logs)))
        (change,) = [each for each in found.changes if each.what == what]
        assert change.value == pytest.approx(
            without + sign * min(rule.first + rule.per_experiment * (logs - 1), rule.most)
        )
        assert (change.before, change.bound) == (without, pytest.approx(without + sign * rule.most))
        assert len(change.witnesses) == logs


def test_falls_to_both_sides_of_a_posture_propose_neither_and_say_so():
    both = (report(1, failure(direction="forward")), report(2, failure(direction="backward")))
    assert "trunk_lean of side_left" not in perturbed(*both)
    assert any("trunk_lean of side_left is not changed" in sentence for sentence in proposal(*both).unproposed)


def test_standing_gets_no_steps_and_no_speeds_but_may_stand_wider():
    still = (0.0, 0.0, 0.0)
    fallen = report(
        1, failure(command=still, direction="left"), failure("slip", command=still), commands=((*still, 5.0),)
    )
    assert perturbed(fallen) == {"step_width of stand": 0.02}


def test_a_perturbation_beyond_its_logs_or_to_the_other_side_is_refused():
    (change,) = [each for each in proposal(report(1, failure("slip"))).changes if each.section == "augmentation"]
    assert allowed_range(change, RULES) == pytest.approx((0.9, 1.0))
    for value in (0.85, 1.1):
        with pytest.raises(ChangeError, match=r"'step_length of side_left' is .*; with 1 log, 0\.9 to 1 is allowed"):
            check_bounds([dataclasses.replace(change, value=value)], RULES)
    with pytest.raises(ChangeError, match=r"has the value 0 before the change, but 1 by the rules"):
        check_bounds([dataclasses.replace(change, before=0.0)], RULES)
    with pytest.raises(ChangeError, match=r"'hop of walk' has no rule in data/feedback_rules\.yaml"):
        check_bounds([dataclasses.replace(change, what="hop of walk")], RULES)


def test_playing_speeds_that_were_approved_when_there_was_nothing_else_still_hold():
    changes = proposal(report(1, failure())).changes
    (change,) = [each for each in changes if each.section == "augmentation"]
    old = dataclasses.replace(change, what="side_left")
    check_bounds([old], RULES)
    with pytest.raises(ChangeError, match=r"time_scale of side_left of t1 occurs twice|side_left of t1 occurs twice"):
        check_bounds([old, change], RULES)
    with pytest.raises(ChangeError, match=r"0 to 0\.15 is allowed"):
        check_bounds([dataclasses.replace(old, value=0.4)], RULES)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "  foot_lift:",
            "  foot_lfit:",
            r"'augmentation\.foot_lfit' is no kind of perturbation; kinds are: time_scale",
        ),
        ("way: both", "way: more", r"'augmentation\.time_scale\.answers\[0\]\.way' is 'more', allowed is both"),
        ("kinds: [slip], directions: []", "kinds: [slip], directions: [up]", r"is 'up', there are: forward, backward"),
        (
            "most: 4.0  ",
            "most: 40.0  ",
            r"'augmentation\.trunk_lean\.most' makes a strength that is -40, allowed is -10",
        ),
        ("kinds: [slip], dir", "kinds: [slpi], dir", r"kinds\[0\]' is 'slpi', there are: fall, stumble"),
    ],
)
def test_a_rule_for_what_kp4_has_not_is_refused_by_name(old, new, says, tmp_path):
    text = (DATA / "feedback_rules.yaml").read_text()
    assert old in text
    path = tmp_path / "feedback_rules.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(SettingsError, match=says):
        settings.read(path, FeedbackRules)


def test_rules_of_the_form_with_playing_speeds_alone_are_refused_in_one_sentence(tmp_path):
    text = (DATA / "feedback_rules.yaml").read_text()
    start, stop = text.index("augmentation:\n"), text.index("motors:")
    old = "augmentation:\n  kinds: [fall]\n  first: 0.15\n  per_experiment: 0.05\n  most: 0.2\n\n"
    path = tmp_path / "feedback_rules.yaml"
    path.write_text(text[:start] + old + text[stop:])
    with pytest.raises(SettingsError, match=r"'augmentation\.kinds' is \['fall'\], expected a mapping"):
        settings.read(path, FeedbackRules)
