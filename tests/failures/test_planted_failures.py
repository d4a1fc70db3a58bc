"""Walks of a published policy with a planted failure each: the small form of benchmarks/failures.py."""

import pytest

from benchmarks.failures import judged, knee_errors
from pipeline.failures.find import find_failures
from pipeline.feedback.cell_weights import with_lowered_limits
from pipeline.feedback.propose import propose
from pipeline.feedback.sim_to_real import simulated, twin_of
from tests.factories.log_trials import FAILURES, trial_of
from tests.factories.trial_reports import COMMANDS, CURATION, RULES
from tests.factories.virtual_trials import KINDS, fallen_knee, planted_trials, walk, walker

pytestmark = pytest.mark.shared
PLANTED = planted_trials(1, 4)


@pytest.fixture(scope="module")
def one(policies):
    return walker(policies)


@pytest.mark.parametrize("planted", PLANTED, ids=lambda each: f"{each.name} {each.seed}")
def test_what_was_planted_is_found_as_that_and_nothing_in_a_sound_walk(planted, one, actuators):
    trial = trial_of(walk(one, planted)[1], one.robot)
    report = find_failures(trial, one.robot, actuators, FAILURES)
    assert judged(planted, report), [each.text() for each in report.failures]
    limit = one.robot.torque_limit[one.robot.joint("Left_Knee_Pitch")]
    assert all(error < 5.0 for error in knee_errors(planted, report, limit))


def test_every_kind_is_planted():
    assert len({each.name for each in PLANTED}) == len(KINDS) + 1


def test_a_weak_knee_is_proposed_and_the_adapted_model_falls_where_the_nominal_one_walks(one, actuators):
    trials = [trial_of(walk(one, fallen_knee(forward))[1], one.robot, f"at_{forward}") for forward in (1.5, 1.9)]
    reports = [find_failures(trial, one.robot, actuators, FAILURES) for trial in trials]
    assert all(any(each.kind == "fall" and each.of_policy for each in report.failures) for report in reports)
    changes = propose(reports, RULES, COMMANDS, CURATION.windows.bounds).changes
    (motor,) = [change for change in changes if change.section == "motors"]
    assert motor.what == "Left_Knee_Pitch"
    assert motor.value == pytest.approx(0.32 * 60.0, rel=0.05)
    trial = trials[1]
    assert simulated(trial, one.robot, with_lowered_limits(actuators, [motor]), one.policy, trial.seconds).fell
    assert not simulated(trial, one.robot, actuators, one.policy, trial.seconds).fell


def test_a_sound_walk_and_its_twin_go_alike(one, actuators):
    side = next(each for each in planted_trials(0, 10) if each.trial.command[0][2] != 0.0)
    trial = trial_of(walk(one, side)[1], one.robot)
    twin = twin_of(trial, one.robot, actuators, one.policy, FAILURES, trial.seconds)
    assert twin is not None and not twin.simulation_fell
    assert twin.achieved == pytest.approx(twin.simulated, abs=0.12)
    assert twin.cycles, twin.notes
    assert all(max(each.shape_distance.values()) < FAILURES.limit_cycle.deviation for each in twin.cycles)
