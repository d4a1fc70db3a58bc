"""The settings that ship, of KP2."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.files import settings as settings_files
from pipeline.repair import RepairSettings


@pytest.fixture(scope="session")
def settings(root: Path) -> RepairSettings:
    return settings_files.read(root / "data" / "repair.yaml", RepairSettings)
