"""Weights: positive, even over commands, shared by variants, the same whatever the order; and what is missing."""

import dataclasses
import importlib
import json
from pathlib import Path

import hypothesis
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.feasibility import CommandSettings, FeasibilitySettings, balance, coverage
from pipeline.feasibility.balance import WITHIN_A_TAKE, BalanceError, effective_seconds_of, takes
from pipeline.feasibility.command_space import by_command
from pipeline.files import settings

ROOT = Path(__file__).resolve().parents[2]
LIMITS = settings.read(ROOT / "data" / "feasibility.yaml", FeasibilitySettings)
COMMANDS = settings.read(ROOT / "data" / "commands.yaml", CommandSettings)


def _row(clip: str, seconds: float = 2.0, forward: float = 0.5, lateral: float = 0.0, yaw: float = 0.0, **more) -> dict:
    said = {"forward_m_s": forward, "lateral_m_s": lateral, "yaw_rate_rad_s": yaw, "root_jerk": 50.0}
    return {"clip": clip, "seconds": seconds, **said, **more}


def _weights(rows: list[dict]) -> dict[str, float]:
    table = balance(pd.DataFrame(rows), LIMITS.balance, COMMANDS)
    return dict(zip(table["clip"], table["weight"], strict=True))


def test_each_command_cell_has_the_same_weight():
    rows = [_row(f"common{index}") for index in range(9)] + [_row("rare", forward=1.1)]
    weights = _weights(rows)
    assert weights["rare"] == pytest.approx(sum(weights[f"common{index}"] for index in range(9)))


def test_no_second_weighs_more_than_the_bound():
    rows = [_row(f"common{index}", seconds=100.0) for index in range(5)] + [_row("rare", seconds=0.5, forward=1.1)]
    table = balance(pd.DataFrame(rows), LIMITS.balance, COMMANDS)
    second = table["weight"] / table["seconds"]
    mean = table["weight"].sum() / table["seconds"].sum()
    assert np.max(second) <= LIMITS.balance.max_ratio * mean * 1.001


def test_variants_of_one_motion_in_one_cell_share_its_weight():
    rows = [_row("alone"), *(_row(f"family{tail}", parent="family") for tail in ("", "~mirror", "~x0.9+1"))]
    weights = _weights(rows)
    assert sum(weight for clip, weight in weights.items() if clip != "alone") == pytest.approx(weights["alone"])


def test_the_parent_is_told_from_the_name_where_it_is_not_said():
    weights = _weights([_row("alone"), _row("family"), _row("family~mirror"), _row("family+3")])
    assert weights["family"] == pytest.approx(weights["alone"] / 3.0)


def test_a_rough_motion_weighs_less():
    weights = _weights([_row("smooth", root_jerk=20.0), _row("rough", root_jerk=400.0)])
    assert weights["rough"] < weights["smooth"] / 3.0


@hypothesis.settings(deadline=None, max_examples=15)
@given(
    st.lists(
        st.tuples(
            st.floats(1.0, 30.0),
            st.floats(-1.0, 3.0),
            st.floats(-1.0, 1.0),
            st.floats(-2.0, 2.0),
            st.floats(0.0, 400.0),
        ),
        min_size=1,
        max_size=30,
    ),
    st.randoms(use_true_random=False),
)
def test_weights_are_positive_with_mean_one_and_do_not_depend_on_order(clips, random):
    rows = [_row(f"c{i}", s, f, side, y, root_jerk=j) for i, (s, f, side, y, j) in enumerate(clips)]
    weights = _weights(rows)
    assert np.mean(list(weights.values())) == pytest.approx(1.0)
    assert all(np.isfinite(weight) and weight > 0.0 for weight in weights.values())
    shuffled = list(rows)
    random.shuffle(shuffled)
    assert _weights(shuffled) == weights


def test_a_table_that_can_not_be_balanced_says_every_fault():
    rows = pd.DataFrame([_row("twice"), _row("twice"), _row("nan", forward=np.nan), _row("none", seconds=0.0)])
    with pytest.raises(BalanceError) as raised:
        balance(rows, LIMITS.balance, COMMANDS)
    for fault in ("'twice' is there twice", "'nan': forward_m_s is not finite", "'none': has no seconds"):
        assert fault in str(raised.value)
    with pytest.raises(BalanceError, match="'root_jerk' is missing"):
        balance(rows.drop(columns="root_jerk"), LIMITS.balance, COMMANDS)


def test_no_clips_have_no_weights():
    assert balance(pd.DataFrame(), LIMITS.balance, COMMANDS).empty


def _takes(*takes: tuple[str, str, float]) -> pd.DataFrame:
    return pd.DataFrame(takes, columns=["clip", "family", "seconds"])


def effective_seconds(rows: pd.DataFrame, weight: np.ndarray) -> float:
    """Of rows with `clip`, `family` and `seconds`."""
    return effective_seconds_of(pd.factorize(rows["family"])[0], takes(rows), rows["seconds"].to_numpy(float), weight)


def test_effective_seconds_are_the_seconds_where_all_weigh_the_same():
    rows = _takes(("a", "a", 1.0), ("b", "b", 2.0), ("c", "c", 5.0))
    assert effective_seconds(rows, np.array([1.0, 2.0, 5.0])) == pytest.approx(8.0)
    assert effective_seconds(rows, np.array([1.0, 0.0, 0.0])) == pytest.approx(1.0)


def test_variants_add_no_effective_seconds_and_pieces_and_windows_of_a_take_do():
    copies = _takes(("a", "a", 4.0), ("a~mirror", "a", 4.0), ("a~x0.9", "a", 4.4))
    assert effective_seconds(copies, np.ones(3)) == pytest.approx(4.4)
    parts = _takes(("a@0-100", "a", 2.0), ("a@200-300+1", "a", 1.0), ("a@200-300+2", "a", 1.0), ("b", "b", 3.0))
    assert effective_seconds(parts, np.array([2.0, 1.0, 1.0, 3.0])) == pytest.approx(7.0)


def test_copies_that_are_not_balanced_away_cost_effective_seconds():
    rows = _takes(("a", "a", 4.0), ("a~mirror", "a", 4.0), ("b", "b", 4.0))
    assert effective_seconds(rows, np.ones(3)) == pytest.approx(36.0 / 5.0)
    assert effective_seconds(rows, np.array([0.5, 0.5, 1.0])) == pytest.approx(8.0)


def test_what_is_missing_is_said_in_words():
    speeds = (-0.5, -0.3, -0.15, 0.15, 0.3, 0.5, 0.7, 0.9, 1.5, 1.7, 1.9)
    rows = [_row(f"f{forward}", forward=forward) for forward in speeds]
    rows += [_row("right", forward=0.0, lateral=-0.5), _row("left", forward=0.0, lateral=0.3)]
    rows += [_row(f"y{yaw}", forward=0.0, yaw=yaw) for yaw in (-1.2, -0.7, 0.3, 0.7, 1.2)]
    rows += [_row("stand", forward=0.0)]
    found = coverage(pd.DataFrame(rows), LIMITS.balance, COMMANDS).missing
    assert "No clip walks forward at 1 to 1.5 m/s." in found
    assert "No clip walks left faster than 0.4 m/s." in found
    assert not any("turns left" in sentence and "faster" not in sentence for sentence in found)
    assert not any("stands" in sentence for sentence in found)
    assert not any("walks back" in sentence for sentence in found)


def test_cells_hold_the_seconds_of_their_clips_and_no_others():
    rows = pd.DataFrame(
        [
            _row("a", 3.0, forward=0.5),
            _row("b", 4.0, forward=0.45),
            _row("c", 5.0, forward=0.5, yaw=1.2),
            _row("d", 6.0, 9.0),
        ]
    )
    cells = coverage(balance(rows, LIMITS.balance, COMMANDS), LIMITS.balance, COMMANDS).cells
    forward = cells[(cells["axis"] == "forward") & np.isclose(cells["low"], 0.4)]
    assert forward["seconds"].tolist() == [7.0]
    assert forward["clips"].tolist() == [2]
    assert forward["effective_seconds"].iloc[0] <= 7.0
    plane = cells[(cells["axis"] == "forward_yaw") & np.isclose(cells["low"], 0.4) & np.isclose(cells["low_2"], 1.0)]
    assert plane["seconds"].tolist() == [5.0]
    assert np.sum(cells.loc[cells["axis"] == "forward", "seconds"]) == 7.0


def test_with_no_clip_at_all_everything_is_missing():
    found = coverage(pd.DataFrame(), LIMITS.balance, COMMANDS)
    assert len(found.missing) == 7
    assert np.sum(found.cells["seconds"]) == 0.0


def test_coverage_spreads_no_column_over_boxes_that_it_does_not_look_at(monkeypatch):
    rows = pd.DataFrame([_row(f"f{forward}", forward=forward) for forward in (0.3, 0.5)])
    module, seen = importlib.import_module("pipeline.feasibility.coverage"), []

    def watched(table: pd.DataFrame) -> pd.DataFrame:
        seen.extend(table.columns)
        return by_command(table)

    monkeypatch.setattr(module, "by_command", watched)
    bare = coverage(rows, LIMITS.balance, COMMANDS)
    laden = coverage(rows.assign(stages="every parameter of every stage", number=1.0), LIMITS.balance, COMMANDS)
    assert set(seen) <= {*module.NEEDED, *module.WHERE_THERE, "family"}
    assert laden.missing == bare.missing
    assert laden.cells.equals(bare.cells)


def test_half_a_power_balances_half():
    half = dataclasses.replace(LIMITS, balance=dataclasses.replace(LIMITS.balance, cell_power=0.0))
    rows = pd.DataFrame([_row(f"common{index}") for index in range(9)] + [_row("rare", forward=1.1)])
    table = balance(rows, half.balance, COMMANDS)
    np.testing.assert_allclose(table["weight"], 1.0)


def _two_speeds(clip: str, slow_s: float, fast_s: float) -> dict:
    spent = [[0.55, 0.05, 0.125, slow_s], [1.15, 0.05, 0.125, fast_s]]
    return _row(clip, slow_s + fast_s, forward=0.8, command_seconds=json.dumps(spent))


def test_seconds_count_for_the_cell_they_are_in_not_for_the_clips_mean():
    cells = coverage(pd.DataFrame([_two_speeds("both", 6.0, 3.0)]), LIMITS.balance, COMMANDS).cells
    line = cells.query("axis == 'forward'")
    forward = dict(zip(line["low"], line["seconds"], strict=True))
    assert forward[0.4] == pytest.approx(6.0)
    assert forward[1.0] == pytest.approx(3.0)
    assert forward[0.8] == 0.0


def test_a_clip_that_visits_a_rare_cell_weighs_more_a_second():
    rows = [_row(f"common{index}", 9.0, forward=0.55) for index in range(9)] + [_two_speeds("both", 6.0, 3.0)]
    weights = _weights(rows)
    assert weights["both"] > 3.0 * weights["common0"]


def test_a_moment_in_a_cell_is_no_presence():
    rows = [_row(f"slow{index}", 10.0, forward=0.55) for index in range(4)]
    rows += [_row("fast", 10.0, forward=1.15), _two_speeds("brief", 9.98, 0.02)]
    weights = _weights(rows)
    assert weights["brief"] < 1.2 * weights["slow0"]


def test_the_ends_of_the_ranges_have_to_be_reached():
    rows = [_row(f"y{yaw}", forward=0.0, yaw=yaw) for yaw in (-1.3, -1.1, -0.7, -0.3, 0.3, 0.7, 1.1)]
    found = coverage(pd.DataFrame(rows), LIMITS.balance, COMMANDS).missing
    assert "No clip turns left faster than 1.25 rad/s." in found
    assert not any("turns right" in sentence for sentence in found)


@pytest.mark.parametrize(("near_s", "far_s"), [(0.2, 0.6), (0.6, 0.2), (0.4, 0.4)])
def test_a_cell_that_has_less_than_it_needs_is_said_however_its_seconds_lie(near_s, far_s):
    walks = [[forward, 0.05, 0.125, 3.0] for forward in np.arange(-0.55, 2.0, 0.1)]
    sides = [[0.05, side, 0.125, 3.0] for side in np.arange(-0.55, 0.4, 0.1)]
    brief = [[0.05, 0.45, 0.125, near_s], [0.05, 0.55, 0.125, far_s]]
    spent = [*walks, *sides, *brief]
    one = _row("all", sum(line[3] for line in spent), command_seconds=json.dumps(spent))
    found = coverage(pd.DataFrame([one]), LIMITS.balance, COMMANDS)
    left = found.cells[(found.cells["axis"] == "lateral") & np.isclose(found.cells["low"], 0.4)]
    assert left["seconds"].tolist() == pytest.approx([0.8])
    assert "No clip walks left faster than 0.4 m/s." in found.missing
    assert not any("walks right" in sentence or "walks forward" in sentence for sentence in found.missing)


def test_effective_seconds_are_those_of_a_table_grouped_by_family_and_take():
    rng, count = np.random.default_rng(0), 400
    names = [
        f"take{take}{ending}" for take in range(30) for ending in ("", "~mirror", "@0-90", "@90-180", "+1", "+2~x0.9")
    ]
    rows = pd.DataFrame({"clip": rng.choice(names, count), "seconds": rng.uniform(0.1, 5.0, count)})
    rows = rows.assign(family=rows["clip"].str.extract(r"take(\d)")[0])
    weight = rng.uniform(0.0, 2.0, count)
    take = rows["clip"].str.replace(WITHIN_A_TAKE, "", regex=True)
    own = rows.assign(take=take).groupby(["family", "take"])["seconds"].sum().groupby(level=0).max()
    of_family = rows.assign(weight=weight).groupby("family")["weight"].sum()
    assert effective_seconds(rows, weight) == pytest.approx(weight.sum() ** 2 / (of_family**2 / own).sum(), rel=1e-12)
