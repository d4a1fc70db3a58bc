"""What all tests share: markers and where the things are that are not in the repository."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    """The project's root folder."""
    return ROOT


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real recordings beside the checkout; a test that asks for it bears the marker `shared`."""
    folder = ROOT.parent / "shared" / "mocap"
    if not folder.is_dir():
        pytest.skip("needs the real recordings of ../shared/mocap, which are not part of the project")
    return folder
