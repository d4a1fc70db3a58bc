"""Approved changes put over the settings of what they feed."""

import dataclasses

import pytest

from pipeline.actuators.adapted_robot import adapt
from pipeline.actuators.settings import ActuatorSettings
from pipeline.augment import AugmentSettings, Strengths
from pipeline.feedback.approved import further_variants, with_raised_limits
from pipeline.feedback.cell_weights import check_limits, with_lowered_limits
from pipeline.feedback.change import Change, ChangeError, Witness
from pipeline.files import settings
from tests.factories.trial_reports import CURATION, DATA

AUGMENT = settings.read(DATA / "augment.yaml", AugmentSettings)
ACTUATORS = settings.read(DATA / "actuators.yaml", ActuatorSettings)


def _change(section: str, what: str, value: float, before: float) -> Change:
    witness = Witness(trial="t", log="log.mcap", sha256="0" * 64, policy="p", simulated=True, said="it fell")
    return Change(section=section, robot="t1", what=what, value=value, before=before, bound=value, witnesses=(witness,))


def test_seconds_of_a_skill_are_multiplied_and_the_others_stay():
    found = with_raised_limits(CURATION, [_change("selection", "side_left", 1.44, 1.0)])
    assert found.most_seconds["side_left"] == pytest.approx(1.44 * CURATION.most_seconds["side_left"])
    rest = {skill: value for skill, value in found.most_seconds.items() if skill != "side_left"}
    assert rest == {skill: value for skill, value in CURATION.most_seconds.items() if skill != "side_left"}
    assert with_raised_limits(CURATION, []) == CURATION


def test_a_skill_gets_the_playing_speeds_that_it_does_not_have_yet():
    for what in ("time_scale of side_left", "side_left"):
        found = further_variants([_change("augmentation", what, 0.15, 0.0)], AUGMENT)
        assert found["side_left"].time_scales == (0.85, 1.15)
        assert not list(found["side_left"].perturbations.each())
    assert further_variants([_change("augmentation", "time_scale of side_left", 0.1, 0.0)], AUGMENT) == {}


def test_a_skill_gets_the_perturbations_that_it_does_not_have_yet():
    asked = [
        _change("augmentation", "foot_lift of walk", 0.02, 0.0),
        _change("augmentation", "trunk_lean of walk", -2.0, 0.0),
        _change("augmentation", "step_length of run", 0.9, 1.0),
    ]
    found = further_variants(asked, AUGMENT)
    assert list(found["walk"].perturbations.each()) == [("foot_lift", 0.02), ("trunk_lean", -2.0)]
    assert list(found["run"].perturbations.each()) == [("step_length", 0.9)]
    assert found["walk"].time_scales == () and found["walk"].mirror == AUGMENT.mirror
    there = dataclasses.replace(AUGMENT, perturbations=Strengths(foot_lift=(0.02,), trunk_lean=(-2.0,)))
    assert list(further_variants(asked, there)) == ["run"]


@pytest.mark.parametrize(
    ("joint", "value", "says"),
    [
        ("Left_Knee_Pitch", 1.5, r"'Left_Knee_Pitch' is 1.5 N m; the lowest allowed is 0.3 of the calibrated 60 N m"),
        ("No_Such_Joint", 36.0, "'No_Such_Joint' is no joint of t1; there are: .*Left_Knee_Pitch"),
    ],
)
def test_a_limit_is_held_against_the_calibration_whatever_a_file_says_it_was_before(robot, joint, value, says):
    actuators = adapt(robot, [], ACTUATORS)
    with pytest.raises(ChangeError, match=says + r".*approve_feedback\), or revoke it"):
        check_limits(actuators, [_change("motors", joint, value, 5.0)], 0.3)
    check_limits(actuators, [_change("motors", "Left_Knee_Pitch", 18.0, 60.0)], 0.3)


def test_a_limit_is_lowered_with_its_motor_line_and_never_raised(robot):
    actuators = adapt(robot, [], ACTUATORS)
    knee = robot.joint("Left_Knee_Pitch")
    line = {"dc_motor_no_load_speed": 16.0, "dc_motor_effort_limit": 60.0, "dc_motor_saturation_effort": 280.0}
    actuators = (*actuators[:knee], dataclasses.replace(actuators[knee], **line), *actuators[knee + 1 :])
    found = with_lowered_limits(actuators, [_change("motors", "Left_Knee_Pitch", 36.0, 60.0)])
    assert found[knee].box_effort_limit == 36.0 and found[knee].dc_motor_effort_limit == 36.0
    fall = 1.0 - found[knee].box_velocity_limit / 16.0
    assert found[knee].dc_motor_saturation_effort == pytest.approx(36.0 / fall)
    assert "log.mcap" in found[knee].verdict and found[knee].changed
    assert found[:knee] + found[knee + 1 :] == actuators[:knee] + actuators[knee + 1 :]
    raised = with_lowered_limits(actuators, [_change("motors", "Left_Knee_Pitch", 70.0, 80.0)])
    assert raised[knee].box_effort_limit == 60.0
