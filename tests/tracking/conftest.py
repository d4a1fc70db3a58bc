"""The shipped tracker and the settings of rollouts."""

from pathlib import Path

import pytest

from pipeline.files import settings
from pipeline.tracking.settings import TrackingSettings


@pytest.fixture(scope="module")
def values(root: Path) -> TrackingSettings:
    return settings.read(root / "data" / "tracking.yaml", TrackingSettings)


@pytest.fixture(scope="module")
def shipped(root: Path) -> Path:
    return root / "robots" / "t1" / "policies" / "tracker" / "tracker.npz"
