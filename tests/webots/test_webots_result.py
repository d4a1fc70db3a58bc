"""A result is read with suspicion, and judged by its bars."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import pytest

from pipeline.webots.booster_lab import SCHEMA
from pipeline.webots.launch import Outcome
from pipeline.webots.result import ResultError, WebotsSettings, parse_result
from pipeline.webots.validate import LABELS, MUJOCO_STAND_IN, WEBOTS, verdict
from tests.factories.webots_bars import STILL

NAMES = ("first", "second")


def a_result(**changes: Any) -> dict[str, Any]:
    rows = [
        {
            "name": name,
            "walked": True,
            "forward_m_s": 0.01,
            "lateral_m_s": 0.0,
            "yaw_rate_rad_s": 0.0,
            "height_m": 0.68,
        }
        for name in NAMES
    ]
    said = {"schema": SCHEMA, "run": "a", "timestep_ms": 5.0, "seconds": 1.2, "fell_s": None, "policy": True}
    return {**said, "segments": rows, **changes}


def judged(settings: WebotsSettings, result: dict[str, Any]):
    outcome = Outcome(status="finished", result=parse_result(json.dumps(result), "a", NAMES))
    return verdict(WEBOTS, outcome, settings, STILL)


def test_a_whole_result_is_read():
    result = parse_result(json.dumps(a_result()), "a", NAMES)
    assert [segment.name for segment in result.segments] == list(NAMES)
    assert result.segments[0].forward_m_s == 0.01
    assert result.fell_s is None


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"timestep_ms": "5"}, "'timestep_ms' is '5', expected a number"),
        ({"seconds": None}, "'seconds' is None"),
        ({"seconds": True}, "'seconds' is True"),
        ({"seconds": 10**400}, "'seconds' is 1000"),
        ({"fell_s": -1e300}, "'fell_s' is -1e[+]300"),
        ({"fell_s": "soon"}, "'fell_s' is 'soon'"),
        ({"segments": []}, "segments are not those of the plan"),
        ({"segments": {"first": 1}}, "segments are not those of the plan"),
        ({"segments": [1, 2]}, "segments are not those of the plan"),
        ({"run": "b"}, "of another run"),
        ({"schema": "booster-lab webots result 0"}, "not an object of schema"),
    ],
)
def test_a_wrong_result_is_refused(changes: dict[str, Any], problem: str):
    with pytest.raises(ResultError, match=problem):
        parse_result(json.dumps(a_result(**changes)), "a", NAMES)


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_numbers_must_be_finite(number: float):
    with pytest.raises(ResultError, match="is not a number"):
        parse_result(json.dumps(a_result(seconds=number)), "a", NAMES)


def test_a_segment_said_to_be_walked_needs_its_figures():
    result = a_result()
    del result["segments"][1]["height_m"]
    with pytest.raises(ResultError, match="'height_m' is None"):
        parse_result(json.dumps(result), "a", NAMES)


def test_figures_within_the_bars_pass(short_walk: WebotsSettings):
    said = judged(short_walk, a_result())
    assert (said.status, said.reasons) == ("passed", ())


def test_every_reason_is_said(short_walk: WebotsSettings):
    result = a_result(fell_s=0.9)
    result["segments"][0] |= {"forward_m_s": 0.2, "yaw_rate_rad_s": -0.3}
    result["segments"][1] |= {"walked": False}
    said = judged(short_walk, result)
    assert said.status == "failed"
    assert said.reasons == (
        "fell after 0.90 s",
        "segment 'first': walks 0.20, 0.00 m/s for 0, 0, off by 0.200, allowed is 0.05",
        "segment 'first': turns -0.30 rad/s for 0, off by 0.300, allowed is 0.05",
        "segment 'second': not walked to its end",
    )


@pytest.mark.parametrize(
    ("command", "reached", "off"),
    [
        ((0.0, 0.0, 0.5), (0.0, 0.0, -0.5), "turns -0.50 rad/s for 0.5, off by 1.000"),
        ((0.0, 0.0, -0.5), (0.0, 0.0, 0.5), "turns 0.50 rad/s for -0.5, off by 1.000"),
        ((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), "turns 0.00 rad/s for 0.5, off by 0.500"),
        ((0.3, 0.0, 0.0), (-0.3, 0.0, 0.0), "walks -0.30, 0.00 m/s for 0.3, 0, off by 0.600"),
        ((0.0, 0.4, 0.0), (0.0, -0.4, 0.0), "walks 0.00, -0.40 m/s for 0, 0.4, off by 0.800"),
        ((0.0, -0.4, 0.5), (0.0, -0.4, 0.5), ""),
    ],
)
def test_walking_or_turning_the_other_way_is_twice_the_command_off(
    short_walk: WebotsSettings, command: tuple[float, ...], reached: tuple[float, ...], off: str
):
    first, *others = short_walk.segments
    asked = dataclasses.replace(short_walk, segments=(dataclasses.replace(first, command=command), *others))
    result = a_result()
    result["segments"][0] |= dict(zip(("forward_m_s", "lateral_m_s", "yaw_rate_rad_s"), reached, strict=True))
    reasons = judged(asked, result).reasons
    assert reasons == ((f"segment 'first': {off}, allowed is 0.05",) if off else ())


def test_a_segment_without_bars_is_not_required_and_of_none_nothing_passes(short_walk: WebotsSettings):
    result = a_result()
    result["segments"][1] |= {"forward_m_s": 0.9}
    outcome = Outcome(status="finished", result=parse_result(json.dumps(result), "a", NAMES))
    first = {"first": STILL["first"]}
    assert verdict(WEBOTS, outcome, short_walk, first).status == "passed"
    assert verdict(WEBOTS, outcome, short_walk, STILL).status == "failed"
    (reason,) = verdict(WEBOTS, outcome, short_walk, {}).reasons
    assert (
        reason
        == "no segment is required (`webots` in the robot's validation.yaml is empty), so that nothing was checked"
    )


def test_standing_without_a_policy_is_no_pass(short_walk: WebotsSettings):
    assert judged(short_walk, a_result(policy=False)).reasons == ("no policy was active",)


def test_no_stand_in_is_called_webots(short_walk: WebotsSettings):
    outcome = Outcome(status="finished", result=parse_result(json.dumps(a_result()), "a", NAMES))
    for engine, label in LABELS.items():
        said = verdict(engine, outcome, short_walk, STILL).to_dict()
        assert said["engine"] == label
        assert (label == "Webots") == (engine == WEBOTS)
        assert engine == WEBOTS or "not Webots" in label


def test_equal_walks_give_equal_verdicts_whatever_their_run(short_walk: WebotsSettings):
    outcome = Outcome(status="finished", result=parse_result(json.dumps(a_result()), "a", NAMES))
    assert outcome.result is not None
    again = dataclasses.replace(outcome, result=dataclasses.replace(outcome.result, run="b"))
    one, two = (verdict(MUJOCO_STAND_IN, each, short_walk, STILL).to_dict() for each in (outcome, again))
    assert one == two
