"""`booster-lab inspect` on a folder of real recordings of every format."""

import json

import pandas as pd
import pytest

from pipeline.cli.main import main


@pytest.mark.shared
def test_every_real_recording_is_told_and_nothing_vanishes_without_a_reason(mocap, capsys):
    assert main(["inspect", "--json", str(mocap)]) == 0
    values = {value["file"].removeprefix(f"{mocap}/"): value for value in json.loads(capsys.readouterr().out)}
    assert set(values) == set(pd.read_csv(mocap / "index.csv")["file"])
    for file, value in values.items():
        lost = "error" in value or value["usable_seconds"] < value["seconds"] - 0.05
        assert not lost or value.get("error") or value["reasons"], file
