"""What the check of the database's commands shows: every cell, before and after weighting, and what is missing."""

import json

import numpy as np
import pandas as pd
import pytest

from assets.database_checks import _every_command
from assets.plan import Plan

PLAN = Plan("expert_db", "database", ())
BEFORE_AND_AFTER = ("seconds", "effective_seconds_before", "effective_seconds")


def index(fastest: float) -> pd.DataFrame:
    """Two clips that go forward and back with every turn, the second mirrored, and step aside up to some speed."""
    forward, yaw = np.arange(-0.55, 2.0, 0.1), np.arange(-1.375, 1.5, 0.25)
    spent = [[ahead, side, turn, 2.0] for ahead in forward for turn in yaw for side in (-0.05, 0.05)]
    spent += [[0.05, side, 0.125, 2.0] for side in np.arange(-0.55, fastest, 0.1)]
    velocity = {"forward_m_s": 0.7, "lateral_m_s": 0.0, "yaw_rate_rad_s": 0.0, "weight": 1.0}
    one = {**velocity, "seconds": 2.0 * len(spent), "command_seconds": json.dumps(spent), "parent": "mine/walk"}
    return pd.DataFrame([{**one, "clip": name} for name in ("mine/walk", "mine/walk~mirror")])


@pytest.mark.parametrize(
    ("fastest", "missing"), [(0.6, "nothing is missing"), (0.3, "No clip walks left faster than 0.3 m/s.")]
)
def test_it_says_what_is_missing_and_passes_where_nothing_is(fastest, missing):
    found = _every_command(PLAN, index(fastest))
    assert found.metadata["found"].value == missing
    assert found.passed == (missing == "nothing is missing")


@pytest.mark.parametrize(
    ("table", "cells"), [("seconds by command", 1 + 13 + 6 + 6), ("seconds by forward speed and yaw rate", 13 * 6)]
)
def test_every_cell_has_its_seconds_and_what_they_count_for_before_and_after_weighting(table, cells):
    records = _every_command(PLAN, index(0.6)).metadata[table].records
    assert len(records) == cells
    for record in records:
        seconds, *counted = (float(str(record.data[name])) for name in BEFORE_AND_AFTER)
        assert seconds > 0.0
        assert counted == pytest.approx([seconds / 2.0] * 2)
