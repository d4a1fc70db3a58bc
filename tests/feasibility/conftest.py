"""The robot that these tests use, and the folder of published policies."""

from pathlib import Path

import pytest

from pipeline.robot import Robot, load_robot


@pytest.fixture(scope="session")
def robot() -> Robot:
    return load_robot("t1")


@pytest.fixture(scope="session")
def policies(root: Path) -> Path:
    """The folder of published policies beside the checkout; a test that asks for it bears the marker `shared`."""
    folder = root.parent / "shared" / "policies"
    if not folder.is_dir():
        pytest.skip("needs the published policies of ../shared/policies, which are not part of the project")
    return folder
