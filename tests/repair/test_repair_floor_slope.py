"""The slope of the ground where feet stand at several heights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.files import settings
from pipeline.repair.floor import _slope
from pipeline.repair.settings import RepairSettings

FPS = 60.0


def stance(start_s: float, stop_s: float, height_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Frames of a foot that stands, and its heights there."""
    frames = np.arange(round(start_s * FPS), round(stop_s * FPS)).astype(float)
    return frames, np.full(len(frames), height_m)


def foot(*stances: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Several stances of one foot."""
    return np.concatenate([each[0] for each in stances]), np.concatenate([each[1] for each in stances])


@pytest.mark.parametrize(
    ("feet", "slope_m_s"),
    [
        ([foot(stance(0.0, 3.0, 0.0)), foot(stance(0.0, 3.0, 0.12))], 0.0),
        ([foot(*(stance(s, s + 0.4, h) for s, h in ((0, 0.0), (1, 0.1), (2, 0.1), (3, 0.0))))], 0.0),
        ([foot(*(stance(s, s + 0.4, 0.02 * s) for s in range(5)))], 0.02),
    ],
    ids=["a foot rests on a step", "up a step and down", "a ground that rises"],
)
def test_stances_at_several_heights_tell_a_slope_that_is_a_number(root: Path, feet, slope_m_s):
    floor = settings.read(root / "data" / "repair.yaml", RepairSettings).floor
    assert _slope(feet, FPS, floor) == pytest.approx(slope_m_s, abs=1e-6)


def test_where_one_stance_is_near_the_middle_height_the_slope_is_a_number(root: Path):
    floor = settings.read(root / "data" / "repair.yaml", RepairSettings).floor
    heights = (-0.2, -0.1, 0.0, 0.1, -0.3)
    assert np.isfinite(_slope([foot(*(stance(s, s + 0.4, h) for s, h in enumerate(heights)))], FPS, floor))
