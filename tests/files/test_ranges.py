"""Values that settings may not have: found when the file is read, all at once, with key, got and allowed."""

from __future__ import annotations

import dataclasses
import re
from typing import Annotated

import pytest

from pipeline.augment import AugmentSettings
from pipeline.catalog import CatalogSettings
from pipeline.errors import SettingsError
from pipeline.files import settings
from pipeline.files.ranges import NOT_NEGATIVE, POSITIVE, Keys, OneOf, Pattern, Range, check, increasing
from pipeline.repair import RepairSettings
from pipeline.retarget import RetargetSettings
from pipeline.selection import Curation
from tests.conftest import ROOT

KINDS = {
    "catalog": CatalogSettings,
    "curation": Curation,
    "repair": RepairSettings,
    "retarget": RetargetSettings,
    "augment": AugmentSettings,
}

PLANTED = [
    ("curation", "label_hz: 30.0", "label_hz: 0", "'windows.label_hz' is 0, allowed is 5 to 1000"),
    ("curation", "shortest_s: 0.5 ", "shortest_s: -3 ", "'shortest_s' is -3, allowed is at least 0"),
    ("curation", "skills: [stand,", "skills: [stnad,", "'skills[0]' is 'stnad', there are: stand, turn_left"),
    ("curation", "  back: 1200", "  bakc: 1200", "unknown key 'most_seconds.bakc', there are: stand"),
    ("curation", "  back: 1200", "  back: -1", "'most_seconds.back' is -1, allowed is at least 0"),
    ("curation", 'licences: ["*"]', 'licences: [""]', "'licences[0]' is '', allowed is a pattern"),
    ("curation", "excluded_clips: []", 'excluded_clips: ["mine/[ab*"]', "its '[' has no ']'"),
    (
        "curation",
        "walk_speed: 1.3",
        "walk_speed: 2.5",
        "'windows.bounds.jog_speed' is 2, allowed is more than",
    ),
    ("catalog", "velocity_s: 0.2", "velocity_s: 0", "'velocity_s' is 0, allowed is 0.01 to 5"),
    ("catalog", "gravity_ratio: 1.28", "gravity_ratio: 1", "'time_base.gravity_ratio' is 1, allowed is more than 1"),
    ("catalog", "pfnn: [60, 120]", "pfnn: [60, 0]", "'time_base.usual_rates_hz.pfnn[1]' is 0, allowed is 1 to 10000"),
    ("repair", "fast_skills: [run,", "fast_skills: [rnu,", "'smooth.fast_skills[0]' is 'rnu', there are: stand"),
    ("repair", "  cutoff_hz: 10.0", "  cutoff_hz: -1", "'smooth.cutoff_hz' is -1, allowed is 0.5 to 1000"),
    ("repair", "longest_gap_s: 0.5", "longest_gap_s: 0.01", "'fill.longest_gap_s' is 0.01, allowed is more than"),
    ("retarget", "speed_share: 0.95", "speed_share: 1.5", "'speed_share' is 1.5, allowed is more than 0 and at most 1"),
    ("retarget", "  trunk: 0.029", "  trunk: 0", "'weights.trunk' is 0, allowed is more than 0"),
    ("augment", "unscaled_skills: [stand]", "unscaled_skills: [stnd]", "'unscaled_skills[0]' is 'stnd', there are"),
    ("augment", "time_scales: [0.9,", "time_scales: [1.0,", "'time_scales[0]' is 1, which is the original"),
]


@pytest.mark.parametrize(("name", "old", "new", "says"), PLANTED, ids=[f"{row[0]}-{row[2]}" for row in PLANTED])
def test_a_value_out_of_range_in_a_file_of_the_project_is_named_with_what_is_allowed(tmp_path, name, old, new, says):
    text = (ROOT / "data" / f"{name}.yaml").read_text()
    assert text.count(old) >= 1
    path = tmp_path / f"{name}.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(SettingsError, match=re.escape(says)) as caught:
        settings.read(path, KINDS[name])
    assert str(path) in str(caught.value)


def test_faults_of_range_type_and_spelling_are_told_together_whatever_object_they_are_in(tmp_path):
    text = (ROOT / "data" / "curation.yaml").read_text()
    for old, new in (
        ("label_hz: 30.0", "label_hz: 0"),
        ("skills: [stand,", "skills: [stnad,"),
        ("cut_price: 0.02", "cut_price: cheap"),
        ("shortest_s: 0.5 ", "shortest_s: -3 "),
        ("turn_radius: 0.3", "turn_radus: 0.3"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "curation.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError) as caught:
        settings.read(path, Curation)
    for part in ("windows.label_hz", "stnad", "'windows.cut_price' is 'cheap'", "'shortest_s' is -3", "turn_radus"):
        assert part in str(caught.value)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Some:
    share: Annotated[float | None, Range(0.0, 1.0)]
    names: Annotated[dict[str, tuple[float, ...]], Keys(keys=Pattern(), values=POSITIVE)]
    low: float
    high: float

    def __post_init__(self) -> None:
        check(increasing(self, "low", "high"))


def test_bounds_are_allowed_unless_they_are_open_and_none_is_not_checked():
    for share in (0.0, 1.0, None):
        values = {"share": share, "names": {"a*": [1.0]}, "low": 0, "high": 1}
        assert settings.parse(Some, values, ROOT / "some.yaml").share == share
    with pytest.raises(SettingsError) as caught:
        settings.parse(Some, {"share": -0.1, "names": {"a": [1.0, 0.0], " ": []}, "low": 1, "high": 1}, ROOT)
    assert re.findall(r"'([^' ]*|names. )' (?:is|has)", str(caught.value)) == ["share", "names. ", "names.a[1]"]
    with pytest.raises(SettingsError, match="'high' is 1, allowed is more than 'low'"):
        settings.parse(Some, {"share": 0, "names": {}, "low": 1, "high": 1}, ROOT)


@pytest.mark.parametrize(
    ("allowed", "good", "bad"),
    [
        (Range(high=3.0), (-9.0, 3.0), (3.1, float("nan"))),
        (NOT_NEGATIVE, (0.0, 1e9), (-1e-9, float("nan"))),
        (POSITIVE, (1e-9,), (0.0, -1.0)),
        (OneOf(("a", "b")), ("a",), ("A", "")),
        (Pattern(), ("*", "lafan1/[ab]*", "CC0*"), ("", " a", "[ab")),
    ],
)
def test_each_kind_of_range_allows_what_it_says(allowed, good, bad):
    assert [allowed.problem(value) for value in good] == [None] * len(good)
    assert all(allowed.problem(value) for value in bad)
