"""The benchmark of feasibility counts what it is given: falls are told, rates are of what walked."""

from benchmarks.feasibility import Judged, commands, known_good_bars


def test_rollouts_that_fell_are_told_and_not_counted_as_known_good():
    good, cut = Judged(labelled=(True, 1.0)), Judged(labelled=(False, 0.5), broken={"foot_slip_p95"})
    bars = {bar.name: bar for bar in known_good_bars([good, cut, Judged(fell=True)], ["foot_slip_p95"])}
    assert bars["known-good rollouts"].value == 2
    assert bars["rollouts that fell, left out"].value == 1
    assert bars["known good: accepted whole"].value == 50.0
    assert bars["known good: seconds accepted"].value == 75.0
    assert bars["known good: hold foot_slip_p95"].value == 50.0


def test_another_seed_draws_other_commands_inside_the_ranges_and_keeps_the_axes():
    first, second = commands(40), commands(40, seed=2)
    assert first[:-40] == second[:-40]
    assert not set(first[-40:]) & set(second[-40:])
    for forward, lateral, yaw in second:
        assert -0.6 - 1e-9 <= forward <= 2.0 + 1e-9
        assert abs(lateral) <= 0.6
        assert abs(yaw) <= 1.5
