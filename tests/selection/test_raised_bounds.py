"""What is said of more seconds of a skill: whether a bound kept windows out, and what a higher one brings."""

import dataclasses

import pandas as pd
import pytest

from pipeline.files import settings as settings_file
from pipeline.selection import Curation, RaisedBound, raised_bounds
from tests.conftest import ROOT

CURATION = settings_file.read(ROOT / "data" / "curation.yaml", Curation)


def windows(*seconds: float, skill: str = "side_left", **more) -> pd.DataFrame:
    """A file a window."""
    rows = [
        {
            "clip": f"{skill}{place}",
            "source": "a",
            "file": f"{place}.bvh",
            "licence": "MIT",
            "skill": skill,
            "seconds": each,
        }
        for place, each in enumerate(seconds)
    ]
    return pd.DataFrame([{**row, **more} for row in rows])


def brought(rows: pd.DataFrame, before: dict[str, float], after: dict[str, float]) -> RaisedBound:
    """What is said of `side_left`."""
    low, high = (dataclasses.replace(CURATION, most_seconds=most) for most in (before, after))
    (found,) = raised_bounds(rows, low, high, ["side_left"])
    return found


def test_a_bound_that_cut_nothing_off_brings_nothing_and_says_so():
    found = brought(windows(8.0, 6.5), {"side_left": 600.0}, {"side_left": 720.0})
    assert not found.reached and found.short and found.more_windows == 0
    assert found.text() == (
        "side_left: feedback requests 720 s, 14.5 s are available: "
        "no more windows, the limit of 600 s excluded none; record more of this skill"
    )


def test_a_bound_that_cut_windows_off_brings_as_many_as_fit_under_the_new_one():
    found = brought(windows(*[2.0] * 9), {"side_left": 10.0}, {"side_left": 12.0})
    assert found.reached and not found.short
    assert (found.before_s, found.taken_s, found.there_s) == (10.0, 12.0, 18.0)
    assert found.text() == (
        "side_left: feedback requests 12 s, 18.0 s are available: 1 more window, "
        "from 10.0 s (limit 10 s) to 12.0 s, 6.0 s not selected"
    )


def test_where_the_new_bound_is_not_filled_a_recording_is_asked_for():
    found = brought(windows(2.0, 2.0, 2.0), {"side_left": 5.0}, {"side_left": 10.0})
    assert found.reached and found.short and found.more_windows == 1
    assert found.text().endswith("to 6.0 s, which is all of them; record more of this skill")
    filled = brought(windows(2.0, 2.0, 2.0), {"side_left": 5.0}, {"side_left": 6.0})
    assert filled.all_taken and not filled.short and filled.text().endswith("which is all of them")


def test_windows_that_fit_under_neither_bound_change_nothing():
    found = brought(windows(2.0, 2.0, 3.0), {"side_left": 5.0}, {"side_left": 6.0})
    assert found.reached and found.more_windows == 0 and not found.short
    assert found.text().endswith("4.0 s selected as before, because none of the other windows fits the limit")


def test_a_longer_window_that_fits_now_may_take_the_place_of_shorter_ones():
    found = brought(windows(2.0, 3.0, 1.0), {"side_left": 4.0}, {"side_left": 5.0})
    assert (found.more_windows, found.fewer_windows) == (1, 1)
    assert "1 more window instead of 1 shorter, from 3.0 s (limit 4 s) to 5.0 s" in found.text()


def test_what_the_curation_excludes_is_not_there_and_other_skills_do_not_count():
    rows = pd.concat(
        [windows(4.0), windows(5.0, notes="time_base").replace("side_left0", "bad"), windows(7.0, skill="run")]
    )
    curation = dataclasses.replace(CURATION, excluded_notes=("time_base",), most_seconds={"side_left": 9.0})
    (found,) = raised_bounds(rows, curation, curation, ["side_left"])
    assert found.there_s == 4.0


@pytest.mark.parametrize("rows", [windows(3.0), pd.DataFrame(columns=["clip"])], ids=["windows", "none"])
def test_a_skill_without_a_bound_and_a_database_without_windows_are_told(rows):
    found = brought(rows, {}, {})
    assert not found.reached and found.short
    assert f"there is no limit, {3.0 * len(rows):.1f} s are available: no more windows; record more" in found.text()


def test_nothing_is_said_where_nothing_is_wanted():
    assert raised_bounds(windows(3.0), CURATION, CURATION, []) == ()
