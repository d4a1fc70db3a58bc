"""What benchmarks print."""

import json

import pytest

from benchmarks.report import Bar, report

MACHINE = {"cores": 2}


@pytest.mark.parametrize(
    ("value", "sense", "bound", "holds"),
    [
        (91.0, ">=", 90.0, True),
        (89.9, ">=", 90.0, False),
        (0.2, "<=", 0.2, True),
        (float("nan"), "<=", 0.2, False),
        (3.0, "", None, None),
    ],
)
def test_json_has_the_agreed_keys(capsys, value, sense, bound, holds):
    bar = Bar(name="agreement", value=value, unit="%", sense=sense, bound=bound)
    assert report([bar], machine=MACHINE, json=True) is (holds is not False)
    printed = json.loads(capsys.readouterr().out)
    assert set(printed) == {"bars", "machine"}
    assert printed["machine"] == MACHINE
    assert set(printed["bars"][0]) == {"name", "value", "unit", "bound", "holds"}
    assert printed["bars"][0]["holds"] is holds


def test_the_table_shows_what_fails(capsys):
    bars = [Bar(name="one", value=1.0, sense=">=", bound=2.0), Bar(name="two", value=3.0, unit="s")]
    assert not report(bars, machine=MACHINE, json=False)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("one") and lines[1].endswith("FAILS")
    assert lines[2].split() == ["two", "3", "s"]
