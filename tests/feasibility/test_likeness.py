"""KP3's figures of a clip held against KP5's file."""

from pathlib import Path

import pytest

from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.assess import parted
from pipeline.feasibility.clip_criteria import likeness
from pipeline.feasibility.criterion import Skipped, groups
from pipeline.files import settings


@pytest.fixture(scope="module")
def limits(root: Path):
    return settings.read(root / "data/feasibility.yaml", FeasibilitySettings).likeness


def test_a_recording_of_the_robot_has_no_figures_and_no_verdicts(limits):
    found = likeness({"seconds": 3.0, "slip_m_s": None}, limits)
    assert all(isinstance(each, Skipped) for each in found)
    assert found[0].not_applicable == "no figure of retargeting: KP3 had no sample of it"


@pytest.mark.parametrize("name", groups()["likeness to the person"])
def test_each_figure_holds_at_its_limit_and_breaks_above_it(name, limits):
    limit = getattr(limits, name)
    (at,), (above,) = (parted(likeness({name: value}, limits))[0] for value in (limit, -1.01 * limit))
    assert at.holds
    assert not above.holds
    assert above.reason(50.0, 0.0, 2.0).code == name
