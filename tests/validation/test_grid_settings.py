"""What `data/cross_engine.yaml` and `data/limit_cycles.yaml` may not ask: what no walk comes to."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from pipeline.errors import SettingsError
from pipeline.files.settings import read
from pipeline.validation.cross_engine_walk import CrossEngineSettings
from pipeline.validation.limit_cycles import LimitCycleSettings


def _walk(seconds: float, forward: float = 0.6) -> dict[str, Any]:
    return {"seconds": seconds, "command": [forward, 0, 0]}


def _grid(root: Path, path: Path, **cell: Any) -> Path:
    """The shipped grid with one cell."""
    grid = yaml.safe_load((root / "data" / "cross_engine.yaml").read_text())
    path.write_text(json.dumps({**grid, "cells": {"one": cell}}))
    return path


@pytest.mark.parametrize(
    ("cell", "told"),
    [
        (
            {"segments": [_walk(4)], "measured_s": 5},
            "'cells.one.measured_s' is 5, allowed is at most the last segment's 4 s",
        ),
        (
            {"segments": [_walk(4), _walk(2, 1.0)], "measured_s": 3},
            "'cells.one.measured_s' is 3, allowed is at most the last segment's 2 s",
        ),
        ({"segments": [_walk(4)], "measured_s": 0.001}, "'cells.one.measured_s' is 0.001, allowed is at least 0.02"),
        ({"segments": [], "measured_s": 1}, "'cells.one.segments' is empty, allowed is at least one"),
        (
            {"segments": [_walk(4)], "measured_s": 1, "push": {"start_s": 4, "impulse": [25, 0]}},
            "'cells.one.push.start_s' is 4, its end at 4.1 s is after the cell's 4 s",
        ),
    ],
)
def test_a_cell_that_asks_for_what_it_never_comes_to_is_refused_with_file_and_key(
    root: Path, tmp_path: Path, cell: dict[str, Any], told: str
):
    path = _grid(root, tmp_path / "cross_engine.yaml", **cell)
    with pytest.raises(SettingsError, match=re.escape(f"{path}: {told}")):
        read(path, CrossEngineSettings)


def test_all_of_the_last_segment_may_be_measured(root: Path, tmp_path: Path):
    path = _grid(root, tmp_path / "cross_engine.yaml", segments=[_walk(4), _walk(2, 1.0)], measured_s=2)
    assert read(path, CrossEngineSettings).cells["one"].measured_s == 2.0


def test_every_other_fault_of_a_cell_is_told_beside(root: Path, tmp_path: Path):
    path = _grid(root, tmp_path / "cross_engine.yaml", segments=[{"seconds": -1, "command": [0, 0, 0]}], measured_s=-2)
    with pytest.raises(SettingsError, match=r"segments\[0\].seconds' is -1.*measured_s' is -2"):
        read(path, CrossEngineSettings)


def test_a_limit_cycle_that_settles_longer_than_it_walks_is_refused(root: Path, tmp_path: Path):
    cycles = yaml.safe_load((root / "data" / "limit_cycles.yaml").read_text())
    path = tmp_path / "limit_cycles.yaml"
    path.write_text(json.dumps({**cycles, "seconds": 3.0, "settled_s": 5.0}))
    with pytest.raises(SettingsError, match=r"'seconds' is 3, allowed is more than"):
        read(path, LimitCycleSettings)
