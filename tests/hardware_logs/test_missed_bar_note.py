"""The note on missed bars: what comes back is what was said, or nothing."""

from __future__ import annotations

import dataclasses
import json

import pytest

from pipeline.hardware_logs.missed_bars import KNOWN, NOTE, MissedBar, note_of, trusted_bars
from tests.factories.robot_logs import facts

SLIP = MissedBar(cell="vx +0.6", figure="slip", got=0.102, asked=0.084, from_s=4.0, until_s=10.0)
KNEE = "Left_Knee_Pitch"


def row(**changes) -> str:
    return json.dumps([{**dataclasses.asdict(SLIP), **changes}])


def test_bars_come_back_as_they_were():
    fell = MissedBar(cell="push kick standing 40 Ns", figure="survival", got=0.5, asked=0.9, from_s=2.0, until_s=2.0)
    weak = MissedBar(cell="a", figure="saturation", got=4.2, asked=3.9, from_s=4.0, until_s=10.0, joint=KNEE)
    notes = note_of((SLIP, fell, weak))
    assert trusted_bars(facts(notes=notes), [KNEE]) == ((SLIP, fell, weak), ())
    assert note_of((SLIP, fell, weak)) == notes
    assert (SLIP.bar, fell.bar) == ("at most 0.084 m/s", "at least 0.9 share")


def test_a_log_without_the_note_says_nothing():
    assert trusted_bars(facts(notes={"floor": "carpet"}), [KNEE]) == ((), ())


def test_a_log_that_does_not_say_that_it_is_simulated_is_not_heard():
    missed, (why,) = trusted_bars(facts(notes=note_of((SLIP,)), simulated=False), [KNEE])
    assert missed == () and "not that it is simulated" in why


@pytest.mark.parametrize(
    "text",
    [
        "",
        "slip",
        "{}",
        "null",
        "[1]",
        "[" * 5000,
        "[[]]",
        "[{}]",
        row(figure="temper"),
        row(figure="shape_distance"),
        row(got=float("nan")),
        row(asked=float("-inf")),
        row(got=1e300),
        row(got=10**400),
        row(got=-1.0),
        row(got="0.102"),
        row(got=True),
        row(got=None),
        row(got=0.01),
        row(until_s=1e9),
        row(from_s=6.0, until_s=2.0),
        row(axis="forward"),
        row(joint="Left_Knee_Pitch"),
        row(figure="saturation", got=4.0, asked=3.0, joint="Tail"),
        row(figure="speed_error"),
        row(figure="speed_error", axis="lateral", achieved=float("nan")),
        row(cell="<script>"),
        row(cell="x" * 500),
        row(command=[1.0, 0.0, 0.0]),
        json.dumps([dataclasses.asdict(SLIP)] * 17),
        row(cell="a" * 30_000),
    ],
    ids=lambda text: text[-30:],
)
def test_what_no_validation_writes_is_left_out(text):
    missed, (why,) = trusted_bars(facts(notes={NOTE: text}), [KNEE])
    assert missed == () and why == "its missed bars can't be right and are left out."


def test_one_wrong_bar_leaves_out_its_neighbours():
    both = [dataclasses.asdict(SLIP), {**dataclasses.asdict(SLIP), "got": 1e300}]
    assert trusted_bars(facts(notes={NOTE: json.dumps(both)}), [KNEE])[0] == ()


@pytest.mark.parametrize("figure", sorted(KNOWN))
def test_a_bar_that_was_held_is_none(figure):
    known = KNOWN[figure]
    axis = known.axes[0] if known.axes else ""
    good, bad = (0.2, 0.5) if known.lower_is_better else (0.5, 0.2)
    bar = MissedBar(cell="a", figure=figure, got=bad, asked=good, from_s=1.0, until_s=2.0, axis=axis)
    with pytest.raises(ValueError, match="holds the bar"):
        dataclasses.replace(bar, got=good)
    with pytest.raises(ValueError, match="not of the axis"):
        dataclasses.replace(bar, axis="up")
