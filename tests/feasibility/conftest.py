"""The settings that ship, of KP5."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.feasibility import FeasibilitySettings
from pipeline.files import settings


@pytest.fixture(scope="session")
def limits(root: Path) -> FeasibilitySettings:
    return settings.read(root / "data" / "feasibility.yaml", FeasibilitySettings)
