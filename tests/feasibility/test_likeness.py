"""KP3's figures of a clip held against KP5's file."""

from pathlib import Path

import pytest

from pipeline.feasibility import FeasibilitySettings
from pipeline.feasibility.likeness_criteria import FIGURES, likeness
from pipeline.files import settings


@pytest.fixture(scope="module")
def limits(root: Path):
    return settings.read(root / "data/feasibility.yaml", FeasibilitySettings).likeness


def test_a_recording_of_the_robot_has_no_figures_and_no_verdicts(limits):
    assert likeness({"seconds": 3.0, "slip_m_s": None}, limits) == ()


@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_holds_at_its_limit_and_breaks_above_it(name, limits):
    limit = getattr(limits, name)
    (at,) = likeness({name: limit}, limits)
    (above,) = likeness({name: -1.01 * limit}, limits)
    assert at.holds
    assert not above.holds
    assert above.reason(50.0, 0.0, 2.0).code == name
