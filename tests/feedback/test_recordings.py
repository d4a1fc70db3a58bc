"""What counts as one recording, by the times and the sensor data of trials, and which of its copies is heard."""

import dataclasses

import pytest

from pipeline.failures.signals import UNKNOWN, WINDOW_NS
from pipeline.failures.trial_report import TrialReport
from pipeline.files import settings
from tests.factories.trial_reports import LEFT_CELL, RULES, failure, proposal, report, saturated, values

START_NS = 3_600_000_000_000_000_000 // 2
WEIGHT = ("weights", LEFT_CELL)
ONE, TWO = RULES.weights.per_experiment, RULES.weights.per_experiment**2


def _timed(number: int, *failures, start_s: float = 0.0, seconds: float = 8.0, data: str = "a", **more) -> TrialReport:
    """A report of a time, with the data of the recording called `data` (one hex digit)."""
    first = START_NS + round(start_s * 1e9)
    prints = "".join(f"{data}{(first // WINDOW_NS + window) % 10**7:07d}" for window in range(round(2 * seconds)))
    said = {"start_ns": first, "seconds": seconds, "fingerprint": prints, **more}
    return report(number, *failures, **said)


def _weight(*reports: TrialReport) -> float:
    return values(proposal(*reports)).get(WEIGHT, 1.0)


@pytest.mark.parametrize("simulated", [True, False])
def test_a_torn_copy_counts_once_with_the_whole(simulated):
    whole = _timed(1, failure(), simulated=simulated)
    torn = _timed(2, failure(), seconds=5.0, whole=False, simulated=simulated)
    assert _weight(whole, torn) == _weight(torn, whole) == ONE
    found = proposal(whole, torn)
    assert {each.log for change in found.changes for each in change.witnesses} == {"log001.mcap"}
    assert "trial002 (log002.mcap) is of the same recording as log001.mcap and counts once with it" in found.unproposed


def test_what_a_torn_copy_alone_shows_does_not_count():
    whole, torn = _timed(1), _timed(2, failure(time_s=4.9), seconds=5.0, whole=False)
    assert proposal(whole, torn).changes == ()


def test_what_a_copy_shows_beyond_the_time_of_the_other_counts():
    beginning = _timed(1, seconds=6.0)
    end = _timed(2, failure(time_s=3.0), start_s=4.0, seconds=4.0)
    assert _weight(beginning, end) == ONE


@pytest.mark.parametrize("gap_s", [0.0, 0.5])
def test_the_files_of_a_split_bag_are_one_log_and_all_are_heard(gap_s):
    first, second, third = (
        _timed(number, failure(kind), start_s=number * (8.0 + gap_s), data=str(number))
        for number, kind in ((1, "fall"), (2, "stumble"), (3, "slip"))
    )
    assert _weight(first, second, third) == _weight(third, first, second) == ONE
    assert "friction" in {change.what for change in proposal(first, second, third).changes}


def test_the_files_of_a_split_bag_are_not_named_as_copies():
    first, second = (_timed(number, failure(), start_s=8.0 * number, data=str(number)) for number in (1, 2))
    assert not any("counts once" in sentence for sentence in proposal(first, second).unproposed)


def test_real_logs_apart_in_time_are_two():
    assert _weight(_timed(1, failure()), _timed(2, failure(), start_s=9.5)) == TWO


def test_two_recorders_of_one_walk_count_once():
    assert _weight(_timed(1, failure()), _timed(2, failure(), start_s=0.01, data="b")) == ONE


@pytest.mark.parametrize("changed", [{"policy": "b" * 64}, {"simulated": True}])
def test_logs_of_another_policy_or_kind_at_the_same_time_are_two_unless_their_data_agree(changed):
    always = dataclasses.replace(RULES, trust=dataclasses.replace(RULES.trust, simulated="always"))
    one = _timed(1, failure())
    for data, wanted in (("b", TWO), ("a", ONE)):
        found = proposal(one, _timed(2, failure(), data=data, **changed), rules=always)
        assert values(found)[WEIGHT] == wanted


def test_simulated_logs_that_begin_at_the_same_moment_are_two_if_any_half_second_differs():
    def logs(*reports: TrialReport) -> int:
        (change,) = [each for each in proposal(*reports).changes if each.section == "weights"]
        return len(change.logs)

    one, other = (_timed(number, failure(), data=data, simulated=True) for number, data in ((1, "a"), (2, "b")))
    assert logs(one, other) == 2
    late = dataclasses.replace(other, fingerprint=one.fingerprint[:-8] + "b" * 8)
    assert logs(one, late) == 2
    unknown = dataclasses.replace(other, fingerprint=one.fingerprint[:-8] + UNKNOWN)
    assert logs(one, unknown) == 1


def test_a_copy_without_its_sidecar_takes_nothing_from_the_first():
    for names in (("a.mcap", "b.mcap"), ("b.mcap", "a.mcap")):
        known = _timed(1, failure(), file=names[0], trial=names[0][0])
        bare = dataclasses.replace(known, file=names[1], trial=names[1][0], policy="", command_known=False, commands=())
        assert _weight(known, bare) == _weight(bare, known) == ONE
        told = proposal(dataclasses.replace(bare, policy=known.policy), known)
        assert values(told)[WEIGHT] == ONE, "of two that can count the one is heard whose command is known"


def test_a_motor_needs_two_recordings():
    one, torn = _timed(1, saturated(36.0)), _timed(2, saturated(36.2), seconds=5.0, whole=False)
    piece = _timed(3, saturated(36.2), start_s=8.0)
    for again in (torn, piece):
        found = proposal(one, again)
        assert "motors" not in {change.section for change in found.changes}
        assert any("1 log shows it, 2 are required" in sentence for sentence in found.unproposed)
    other = _timed(4, saturated(36.4), start_s=60.0)
    assert values(proposal(one, torn, other))[("motors", "Left_Knee_Pitch")] == pytest.approx(36.2)


def test_the_share_of_logs_that_fail_is_of_recordings():
    sound = [_timed(number, start_s=20.0 * number) for number in range(2, 6)]
    copies = [_timed(number, start_s=40.0, seconds=7.0) for number in range(10, 20)]
    assert _weight(_timed(1, failure()), *sound, *copies) == ONE


def test_reports_that_know_no_time_are_told_apart_by_their_bytes():
    assert _weight(report(1, failure()), report(2, failure())) == TWO
    old = {
        key: value
        for key, value in settings.plain(report(1, failure())).items()
        if key not in ("start_ns", "fingerprint", "whole")
    }
    assert TrialReport.from_dict(old) == report(1, failure())
    new = _timed(1, failure())
    assert TrialReport.from_dict(settings.plain(new)) == new
