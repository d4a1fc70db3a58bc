"""Factors on command cells: exact for clips of one cell, raked for mixed ones, and never past the bound of a second."""

import dataclasses
import json

import hypothesis
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.feasibility import FeasibilitySettings, balance
from pipeline.feedback.cell_weights import cell_parts, reweigh
from pipeline.files import settings
from tests.factories.trial_reports import COMMANDS, DATA

LEFT, AHEAD = "0.0 m/s, 0.4 m/s, 0.0 rad/s", "0.6 m/s, 0.0 m/s, 0.0 rad/s"
FEASIBILITY = settings.read(DATA / "feasibility.yaml", FeasibilitySettings)
FREE = dataclasses.replace(FEASIBILITY.balance, max_ratio=1e6)


def _clip(name: str, seconds: float, boxes: list[tuple[float, float, float, float]]) -> dict:
    """A clip with its seconds by velocity."""
    mean = np.average([box[:3] for box in boxes], axis=0, weights=[box[3] for box in boxes])
    return {
        "clip": name,
        "seconds": seconds,
        "forward_m_s": mean[0],
        "lateral_m_s": mean[1],
        "yaw_rate_rad_s": mean[2],
        "root_jerk": 50.0,
        "command_seconds": json.dumps(boxes),
    }


def _left(seconds: float) -> tuple[float, float, float, float]:
    return (0.0, 0.4, 0.0, seconds)


def _ahead(seconds: float) -> tuple[float, float, float, float]:
    return (0.6, 0.0, 0.0, seconds)


def _share(rows: pd.DataFrame, weights: dict[str, float], cell: str) -> float:
    weight = np.array([weights[clip] for clip in rows["clip"]])
    return float(weight @ cell_parts(rows, [cell], COMMANDS)[:, 0] / weight.sum())


def _balanced(*clips: dict) -> pd.DataFrame:
    return balance(pd.DataFrame(clips), FEASIBILITY.balance, COMMANDS)


def test_clips_of_one_cell_weigh_the_factor_as_much_against_the_rest():
    rows = _balanced(_clip("left", 4.0, [_left(4.0)]), _clip("ahead", 6.0, [_ahead(6.0)]))
    old = dict(zip(rows["clip"], rows["weight"], strict=True))
    new = reweigh(rows, {LEFT: 1.5}, FREE, COMMANDS).weight
    assert new["left"] / new["ahead"] == pytest.approx(1.5 * old["left"] / old["ahead"])
    assert np.mean(list(new.values())) == pytest.approx(1.0)


def test_a_mixed_clip_is_raised_until_the_cell_has_its_share():
    clips = [_clip("mixed", 8.0, [_left(2.0), _ahead(6.0)]), _clip("left", 2.0, [_left(2.0)])]
    rows = _balanced(*clips, _clip("ahead", 6.0, [_ahead(6.0)]))
    found = reweigh(rows, {LEFT: 1.8}, FREE, COMMANDS)
    (cell,) = found.cells
    assert cell.target == pytest.approx(1.8 * cell.before / (1.0 + 0.8 * cell.before))
    assert cell.reached == pytest.approx(cell.target, rel=1e-6)
    assert _share(rows, found.weight, LEFT) == pytest.approx(cell.reached)


def test_where_the_clips_do_not_allow_it_the_share_that_was_reached_is_told():
    rows = _balanced(_clip("mixed", 8.0, [_left(2.0), _ahead(6.0)]))
    (cell,) = reweigh(rows, {LEFT: 2.0}, FREE, COMMANDS).cells
    assert cell.reached == pytest.approx(cell.before) and cell.target > cell.before


def test_a_cell_without_clips_changes_nothing():
    rows = _balanced(_clip("ahead", 6.0, [_ahead(6.0)]), _clip("left", 4.0, [_left(4.0)]))
    found = reweigh(rows, {"2.0 m/s, 0.0 m/s, 0.0 rad/s": 2.0}, FREE, COMMANDS)
    assert found.cells[0].clips == 0
    assert list(found.weight.values()) == pytest.approx(rows["weight"].tolist())


def test_no_second_passes_the_bound_of_the_balance():
    rows = _balanced(_clip("left", 0.6, [_left(0.6)]), *(_clip(f"a{n}", 50.0, [_ahead(50.0)]) for n in range(4)))
    limit = 3.0
    bound = dataclasses.replace(FEASIBILITY.balance, max_ratio=limit)
    second = rows["weight"] / rows["seconds"]
    before = float(second.max() * rows["seconds"].sum() / rows["weight"].sum())
    new = reweigh(rows, {LEFT: 2.0}, bound, COMMANDS).weight
    raised = np.array([new[clip] for clip in rows["clip"]])
    ratio = (raised / rows["seconds"]).max() * rows["seconds"].sum() / raised.sum()
    assert ratio <= max(limit, before) * 1.001


def test_a_raise_that_cannot_be_had_lowers_no_other_cell():
    same = [_left(1e-3), _ahead(1.0)]
    rows = _balanced(_clip("a", 1.0, same), _clip("b", 1.0, same), _clip("rest", 5.0, [(0.0, 0.0, 1.0, 5.0)]))
    for cell in reweigh(rows, {LEFT: 2.0, AHEAD: 1.0}, FREE, COMMANDS).cells:
        assert cell.reached >= cell.before * (1.0 - 1e-9)


@hypothesis.settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.5, 20.0), st.floats(0.0, 1.0)), min_size=2, max_size=8),
    st.floats(1.0, 2.0),
    st.floats(1.0, 2.0),
)
def test_weights_stay_positive_and_no_cell_falls_against_the_rest(clips, left, ahead):
    rows = _balanced(
        *(
            _clip(f"c{n}", seconds, [_left(part * seconds + 1e-3), _ahead((1.0 - part) * seconds + 1e-3)])
            for n, (seconds, part) in enumerate(clips)
        ),
        _clip("rest", 5.0, [(0.0, 0.0, 1.0, 5.0)]),
    )
    found = reweigh(rows, {LEFT: left, AHEAD: ahead}, FREE, COMMANDS)
    assert min(found.weight.values()) > 0.0
    assert sum(cell.reached for cell in found.cells) >= sum(cell.before for cell in found.cells) - 1e-6
