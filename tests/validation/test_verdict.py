"""Bars from a reference, one verdict with every reason, and a file that says what it was made of."""

import dataclasses
import json
from pathlib import Path

import pytest

from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.robot import Robot
from pipeline.robot.size import RobotSize
from pipeline.validation.bars import (
    Agreement,
    Bar,
    CellBars,
    Margin,
    Reference,
    Required,
    RobotBars,
    Tolerance,
    ValidationSettings,
    derived,
    read_validation,
)
from pipeline.validation.cells import SURVIVING
from pipeline.validation.derive import text_of
from pipeline.validation.figures import FIGURES, Measured
from pipeline.validation.suites import full, quick
from pipeline.validation.verdict import Verdict, as_text, judge
from tests.factories.validation_walks import cell, measured

MARGINS = {
    name: Margin(
        share=0.1 if name not in ("falls", "survival") else 0.0,
        absolute={"falls": 0.0, "survival": 0.1}.get(name, 0.05),
        unit=figure.unit,
        source="test",
    )
    for name, figure in FIGURES.items()
}
REQUIRED = Required(error_share=0.3, least_error=0.15, survival=0.75, period_difference=0.1, source="test")

AGREEMENT = Agreement(
    velocity=Tolerance(at_most=0.07, share=0.08, unit="m/s", source="test"),
    yaw_rate=Tolerance(at_most=0.06, unit="rad/s", source="test"),
    height=Tolerance(at_most=0.01, unit="m", source="test"),
)


def _settings(*reference: Measured) -> ValidationSettings:
    return ValidationSettings(
        calibrated_on=RobotSize(leg_length=0.5516, mass=31.734),
        margins=MARGINS,
        required=REQUIRED,
        agreement=AGREEMENT,
        reference=Reference(policy="p", robot="r", ankle_kd=(1.0,), command="derive"),
        cells=derived([reference], MARGINS, REQUIRED),
        engines={},
        webots={},
        limit_cycles={},
    )


def _judged(bars: ValidationSettings, *found: Measured) -> Verdict:
    return judge(found, bars, suite="quick", policy="p", robot="r")


def test_a_bar_is_the_references_worst_with_its_margin():
    bars = _settings(measured(cell("a"), {"speed_error": 0.1}, {"speed_error": 0.2})).cells["a"]
    assert bars.required
    assert bars.bars["speed_error"].at_most == pytest.approx(0.2 * 1.1 + 0.05)
    assert bars.bars["falls"].at_most == 0.0
    assert "0.2" in bars.bars["speed_error"].source


def test_of_several_measurements_the_worst_counts():
    one, other = (measured(cell("a", 1), {"speed_error": error}) for error in (0.1, 0.25))
    bars = derived([[one], [other]], MARGINS, REQUIRED)["a"]
    assert bars.bars["speed_error"].at_most == pytest.approx(0.25 * 1.1 + 0.05)
    assert "of 2 trials" in bars.bars["speed_error"].source


@pytest.mark.parametrize(
    ("trials", "why"),
    [
        (({"fell": 1.0, "fell_s": 1.0}, {}), "falls in 1 of 2"),
        (({"speed_error": 0.31}, {}), r"misses the command by 0.31 m/s"),
        (({}, {"yaw_rate_error": 0.2}), r"misses the command by 0.20 rad/s"),
    ],
)
def test_what_the_reference_does_not_do_is_not_required_and_says_why(trials: tuple, why: str):
    bars = _settings(measured(cell("a"), *trials)).cells["a"]
    assert not bars.required
    assert why in bars.why


def test_pushes_are_required_where_the_reference_mostly_survives():
    pushed = cell("p", 10, SURVIVING)
    fallen = {"fell": 1.0, "fell_s": 1.0}
    some = _settings(measured(pushed, *([{}] * 8 + [fallen] * 2))).cells["p"]
    assert some.required
    assert some.bars["survival"].at_least == pytest.approx(0.7)
    few = _settings(measured(pushed, *([{}] * 7 + [fallen] * 3))).cells["p"]
    assert not few.required


def test_every_reason_is_given_and_only_required_cells_count():
    bars = _settings(
        measured(cell("a"), {}, {}), measured(cell("b"), {}, {}), measured(cell("c"), {"speed_error": 0.9}, {})
    )
    bad = {"speed_error": 0.5, "power": 900.0, "slip": 0.5}
    verdict = _judged(bars, measured(cell("a"), bad, {}), measured(cell("b"), {}, {}), measured(cell("c"), bad, bad))
    assert not verdict.passed
    assert [(reason.cell, reason.figure) for reason in verdict.reasons] == [
        ("a", "speed_error"),
        ("a", "power"),
        ("a", "slip"),
    ]
    assert [each.word for each in verdict.cells] == ["failed", "passed", "not required"]
    assert str(verdict.reasons[0]) == "a: speed error 0.5 m/s, asked is at most 0.16 m/s"
    text = as_text(verdict)
    assert "failed  a: power 900 W" in text
    assert "not required  c" in text
    assert text.endswith("1 of 2 required cells failed")


def test_the_reference_passes_its_own_bars():
    found = measured(cell("a"), {"speed_error": 0.29, "slip": 0.2}, {})
    assert _judged(_settings(found), found).passed


def test_where_every_trial_falls_the_fall_is_the_reason():
    verdict = _judged(_settings(measured(cell("a", 1), {})), measured(cell("a", 1), {"fell": 1.0, "fell_s": 1.0}))
    assert [str(reason) for reason in verdict.reasons] == ["a: falls 1 trials, asked is at most 0 trials"]


def test_nothing_that_is_required_is_no_pass():
    verdict = _judged(_settings(measured(cell("a"), {}, {})), measured(cell("unknown"), {}, {}))
    assert not verdict.passed
    assert verdict.cells[0].bars.why == "the robot's validation.yaml has no bars for it"
    assert as_text(verdict).endswith("no cell is required: nothing was shown")


def test_bars_of_another_robot_are_said_and_hold_all_the_same():
    """Plain `robots/t1` was held to the adapted robot's bars, and nothing said so."""
    found = measured(cell("a"), {}, {})
    own = _judged(_settings(found), found)
    assert own.to_dict()["note"] is None
    assert "note" not in as_text(own)
    other = judge([found], _settings(found), suite="quick", policy="p", robot="another")
    assert other.passed and own.passed
    assert (other.to_dict()["robot"], other.to_dict()["robot_of_bars"]) == ("another", "r")
    assert "were derived on another robot (r) than the evaluated one (another)" in other.to_dict()["note"]
    assert "materialize `adapted_robot`" in other.note
    assert as_text(other).splitlines()[-2:] == [f"  note  {other.note}", "passed"]


def test_the_verdict_is_json_without_nan():
    verdict = _judged(
        _settings(measured(cell("a"), {}, {})), measured(cell("a"), {"fell": 1.0, "fell_s": 1.0}, {"power": 500.0})
    )
    said = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
    assert said["passed"] is False
    assert said["cells"][0]["fell"] == [0]
    assert said["cells"][0]["spread"]["power"]["mean"] == 500.0


def test_the_file_is_what_was_derived(tmp_path: Path):
    found = _settings(measured(cell("a"), {}, {}), measured(cell("p", 4, SURVIVING), {}, {}, {}, {}))
    path = tmp_path / "validation.yaml"
    path.write_text(text_of(found))
    read = settings.read(path, RobotBars)
    assert read == RobotBars(**{field.name: getattr(found, field.name) for field in dataclasses.fields(RobotBars)})
    assert text_of(read) == text_of(found)


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("slip: {unit", "slipping: {unit", r"unknown key 'cells.vx -0.6.bars.slipping', there are: falls, survival"),
        (
            "at_most: 3.5833",
            "at_most: null",
            "'cells.vx -0.6.bars.saturation.at_most' and 'at_least': allowed is exactly one",
        ),
        ("at_most: 3.5833", "at_most: 3.5, at_least: 1.0", "bars.saturation.at_most' and 'at_least'"),
    ],
)
def test_a_bar_that_would_hold_whatever_is_found_is_refused(
    root: Path, tmp_path: Path, right: str, wrong: str, told: str
):
    """A misspelt figure, or one without a side, let every policy pass."""
    path, text = tmp_path / "validation.yaml", (root / "robots/t1/validation.yaml").read_text()
    assert right in text
    path.write_text(text.replace(right, wrong, 1))
    with pytest.raises(SettingsError, match=told):
        settings.read(path, RobotBars)


def test_the_shipped_bars_are_of_the_cells_that_there_are(root: Path, robot: Robot):
    shipped = read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")
    cells = {each.name: each for each in full(robot)}
    assert list(shipped.cells) == list(cells)
    assert set(shipped.margins) == set(FIGURES)
    for name, bars in shipped.cells.items():
        assert bars.required == (not bars.why), name
        assert not bars.required or set(bars.bars) == set(cells[name].figures), name
        for figure, bar in bars.bars.items():
            assert (bar.at_most is None) != (bar.at_least is None)
            assert bar.unit == FIGURES[figure].unit
            assert bar.source
    assert sum(bars.required for bars in shipped.cells.values()) > 60


def test_pushes_of_the_quick_suite_are_such_as_the_reference_survives_all_of(root: Path, robot: Robot):
    shipped = read_validation(root / "data/validation.yaml", root / "robots/t1/validation.yaml")
    for each in quick(robot):
        if "survival" in each.figures:
            bar = shipped.cells[each.name].bars["survival"].at_least
            assert bar == pytest.approx(1.0 - shipped.margins["survival"].absolute)


def test_a_bar_holds_at_its_value():
    bar = Bar(unit="m/s", source="test", at_most=0.2)
    assert bar.holds(0.2)
    assert not bar.holds(0.2000001)
    assert dataclasses.replace(bar, at_most=None, at_least=0.2).holds(0.2)
    assert CellBars(required=True, why="", bars={}).bars == {}
